"""Signals at random instants while the pipeline records: exit code, metadata, time to the end.

Each run starts a pipeline that films and records a simulated tray, waits until the recording is
there and a random time more, and sends SIGINT, SIGTERM or two of them 0.05 to 2 s apart; half of
the runs on a busy machine, with two more processes for each core. The table counts the runs that
ended with exit code 0 and left a complete bag with its metadata.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.recordings.bag.reader import open_bag

if TYPE_CHECKING:
    from collections.abc import Iterator

_RUNS = 200
_PATTERNS = (
    (signal.SIGINT,),
    (signal.SIGTERM,),
    (signal.SIGINT, signal.SIGINT),
    (signal.SIGINT, signal.SIGTERM),
    (signal.SIGTERM, signal.SIGINT),
    (signal.SIGTERM, signal.SIGTERM),
)
_LONGEST_WAIT_S = 3.0
_GAPS_S = 0.05, 2.0
_STARTS_WITHIN_S, _ENDS_WITHIN_S = 900.0, 60.0
_DOMAIN = 77
_CHECK_S = 0.005
_BUSY_PER_CORE = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How one run ended.

    Parameters
    ----------
    code : int
        Exit code.
    complete : bool
        Whether the bag has metadata and is complete.
    seconds : float, [s]
        From the first signal to the end of the process.
    """

    code: int
    complete: bool
    seconds: float


def report() -> None:
    """Print the table."""
    draw = random.Random(2026)
    results: dict[tuple[str, bool], list[Ended]] = defaultdict(list)
    for run in range(_RUNS):
        pattern = _PATTERNS[run % len(_PATTERNS)]
        busy = run // len(_PATTERNS) % 2 == 1
        wait, gap = draw.uniform(0.0, _LONGEST_WAIT_S), draw.uniform(*_GAPS_S)
        with _load(busy):
            ended = signalled(pattern, wait, gap)
        results[' '.join(number.name for number in pattern), busy].append(ended)
        print(f'{run + 1} of {_RUNS} runs', end='\r', file=sys.stderr, flush=True)
    print('| signals | machine | runs | exit code 0 | complete bags | median [s] | longest [s] |')
    print('| --- ' * 7 + '|')
    for (names, busy), runs in sorted(results.items()):
        seconds = sorted(ended.seconds for ended in runs)
        print(
            f'| {names} | {"busy" if busy else "quiet"} | {len(runs)} '
            f'| {sum(ended.code == 0 for ended in runs)} '
            f'| {sum(ended.complete for ended in runs)} '
            f'| {seconds[len(seconds) // 2]:.2f} | {seconds[-1]:.2f} |'
        )


def signalled(pattern: tuple[signal.Signals, ...], wait: float, gap: float) -> Ended:
    """Record, send signals, and look at what is left.

    Parameters
    ----------
    pattern : tuple of signal.Signals
    wait : float, [s]
        From the first message of the recording to the first signal.
    gap : float, [s]
        Between two signals.
    """
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        process = _recording(bag)
        _await(bag, process)
        time.sleep(wait)
        start = time.monotonic()
        process.send_signal(pattern[0])
        for number in pattern[1:]:
            _wait_at_most(process, gap)
            process.send_signal(number)
        code = process.wait(_ENDS_WITHIN_S)
        seconds = time.monotonic() - start
        complete = (bag / 'metadata.yaml').exists() and open_bag(bag).complete
        return Ended(code=code, complete=complete, seconds=seconds)


def _recording(bag: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, '-m', 'nanorocks_ros.nodes', 'pipeline', '--ros-args']
    for parameter in ('source:=simulator', 'duration:=600.0', f'record:={bag}'):
        command += ['-p', parameter]
    environment = dict(
        os.environ, ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST', ROS_DOMAIN_ID=str(_DOMAIN)
    )
    return subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def _await(bag: Path, process: subprocess.Popen[bytes]) -> None:
    """Wait until the recording has begun."""
    end = time.monotonic() + _STARTS_WITHIN_S
    while not list(bag.glob('*.mcap')):
        if process.poll() is not None or time.monotonic() > end:
            raise RuntimeError(f'the pipeline did not record (exit code {process.poll()})')
        time.sleep(_CHECK_S)


def _wait_at_most(process: subprocess.Popen[bytes], seconds: float) -> None:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return


@contextmanager
def _load(busy: bool) -> Iterator[None]:
    """Keep all cores busy meanwhile."""
    count = _BUSY_PER_CORE * len(os.sched_getaffinity(0)) if busy else 0
    processes = [
        subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(count)
    ]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
