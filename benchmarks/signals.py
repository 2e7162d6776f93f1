"""Signals at random instants while the pipeline records: exit code, metadata, time to the end.

Each run starts a pipeline that films and records a simulated tray, waits until the recording is
there and a random time more, and sends SIGINT, SIGTERM or two of them 0.05 to 2 s apart; half of
the runs on a busy machine, with two more processes for each core. The table counts the runs that
ended with exit code 0 and left a complete bag with its metadata, and tells how long that took:
from the first signal, and from the end of the loop, in which the node finishes what it is at, to
the end of the process. Beside it stands how many threads of the machine had or wanted a core when
the signal was sent: its other work, too.

The pipelines are forked from this process, which has loaded libraries and compiled functions: a
start of its own would take most of the time, and has no part in the end.

``python -m benchmarks signals --count 200 --journal signals.jsonl`` makes the runs that the
journal lacks and prints the table of all of them, so it may be interrupted and called again.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import journal
from benchmarks.fuzzing.mutations import generator_of
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes.run import main as main_of_node
from nanorocks_ros.nodes.run import node_class
from nanorocks_ros.pipeline.warm_up import (
    warm_up,
    warm_up_clusters,
    warm_up_cooling,
    warm_up_speed,
)
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.tray_camera.tray_film import film

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from multiprocessing.context import ForkProcess

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
_DOMAIN = '77'
_CHECK_S = 0.005
_BUSY_PER_CORE = 2
_SOON_S = 1.0
# What a node logs when its loop has ended, with the time.
_LOOP_ENDED = re.compile(r'\[(\d+\.\d+)\] \[nanorocks\.pipeline\]: interrupted by SIG')


@dataclass(frozen=True, slots=True)
class Ended:
    """How one run ended.

    Parameters
    ----------
    names : str
        Of the signals.
    busy : bool
        Whether the machine was busy.
    code : int
        Exit code.
    complete : bool
        Whether the bag has metadata and is complete.
    seconds : float, [s]
        From the first signal to the end of the process.
    after_loop : float, [s]
        From the end of the loop to the end of the process; NaN if that end was not logged.
    load : int
        Threads that had or wanted a core at the first signal.
    """

    names: str
    busy: bool
    code: int
    complete: bool
    seconds: float
    after_loop: float
    load: int

    @property
    def good(self) -> bool:
        """Whether nothing was lost."""
        return self.code == 0 and self.complete


def main(arguments: Sequence[str]) -> int:
    """Run and print; 1 if a run did not end as it should."""
    parser = argparse.ArgumentParser(prog='benchmarks signals', description=__doc__.split(':')[0])
    parser.add_argument('--count', type=int, default=200, help='runs of all kinds together')
    parser.add_argument('--journal', help='file of outcomes, to which this call adds')
    options = parser.parse_args(arguments)
    done = journal.read(options.journal)
    _load_everything()
    try:
        for number in range(options.count):
            if number not in done:
                done[number] = list(astuple(_run(number)))
                journal.note(options.journal, number, done[number])
    except KeyboardInterrupt:
        print('interrupted; the same command continues', file=sys.stderr)
    runs = [Ended(*outcome) for outcome in done.values()]
    print(table(runs))
    print(_soon(runs))
    return int(not all(run.good for run in runs))


def _load_everything() -> None:
    """What a pipeline loads and compiles when it starts, but nothing of ROS that has threads."""
    node_class('pipeline')
    for _ in film(SimulationSettings(), load_trays()[1], frames=2):
        pass
    warm_up()
    warm_up_speed()
    warm_up_clusters()
    warm_up_cooling()


def _run(number: int) -> Ended:
    random = generator_of('signals', number)
    pattern = _PATTERNS[number % len(_PATTERNS)]
    busy = number // len(_PATTERNS) % 2 == 1
    wait, gap = random.uniform(0.0, _LONGEST_WAIT_S), random.uniform(*_GAPS_S)
    return signalled(pattern, wait, gap, busy=busy)


def table(runs: list[Ended]) -> str:
    """Runs of each kind, how many ended well, and how long it took: median, 95 %, longest."""
    lines = [
        '| signals | machine | threads at work | runs | exit code 0 | complete bags '
        '| after the signal [s] | after the loop [s] |',
        '| --- ' * 8 + '|',
    ]
    for names, busy in sorted({(run.names, run.busy) for run in runs}):
        own = [run for run in runs if (run.names, run.busy) == (names, busy)]
        lines.append(_row(names, busy, own))
    lines += [
        _row('all', busy, [run for run in runs if run.busy == busy])
        for busy in sorted({run.busy for run in runs})
    ]
    return '\n'.join(lines)


def _soon(runs: list[Ended]) -> str:
    """How many runs ended soon after the loop."""
    counts = [
        f'{sum(run.after_loop < _SOON_S for run in own)} of {len(own)} '
        f'({"busy" if busy else "quiet"})'
        for busy in (False, True)
        if (own := [run for run in runs if run.busy == busy])
    ]
    return f'below {_SOON_S:g} s after the loop: {", ".join(counts)}'


def _row(names: str, busy: bool, runs: list[Ended]) -> str:
    loads = [run.load for run in runs]
    return (
        f'| {names} | {"busy" if busy else "quiet"} | {np.median(loads):.0f} ({max(loads)}) '
        f'| {len(runs)} | {sum(run.code == 0 for run in runs)} '
        f'| {sum(run.complete for run in runs)} '
        f'| {_times([run.seconds for run in runs])} | {_times([run.after_loop for run in runs])} |'
    )


def _times(seconds: list[float]) -> str:
    median, most, longest = np.nanquantile(seconds, (0.5, 0.95, 1.0))
    return f'{median:.2f}, {most:.2f}, {longest:.2f}'


def signalled(
    pattern: tuple[signal.Signals, ...], wait: float, gap: float, *, busy: bool
) -> Ended:
    """Record, send signals, and look at what is left.

    Parameters
    ----------
    pattern : tuple of signal.Signals
    wait : float, [s]
        From the first message of the recording to the first signal.
    gap : float, [s]
        Between two signals.
    busy : bool
        Whether all cores are busy from the first message to the end.
    """
    with tempfile.TemporaryDirectory() as folder:
        bag, log = Path(folder) / 'bag', Path(folder) / 'log'
        process = _recording(bag, log)
        try:
            _await(bag, process)
            with _load(busy):
                time.sleep(wait)
                load = _wanted_cores()
                start, end = _ended(process, pattern, gap)
        finally:
            process.kill()
            process.join()
        complete = (bag / 'metadata.yaml').exists() and open_bag(bag).complete
        logged = _LOOP_ENDED.search(log.read_text('utf-8'))
        after_loop = end - float(logged[1]) if logged else math.nan
        names = ' '.join(each.name for each in pattern)
        return Ended(names, busy, process.exitcode, complete, end - start, after_loop, load)


def _ended(
    process: ForkProcess, pattern: tuple[signal.Signals, ...], gap: float
) -> tuple[float, float]:
    """Send the signals; the times of the first and of the end, on the clock of the log, [s]."""
    start = time.time()
    _send(process, pattern[0])
    for number in pattern[1:]:
        process.join(gap)
        _send(process, number)
    process.join(_ENDS_WITHIN_S)
    return start, time.time()


def _send(process: ForkProcess, number: signal.Signals) -> None:
    if process.is_alive() and process.pid is not None:
        os.kill(process.pid, number)


def _wanted_cores() -> int:
    """Threads of this machine that have or want a core, less this one."""
    return int(Path('/proc/loadavg').read_text('ascii').split()[3].split('/')[0]) - 1


def _recording(bag: Path, log: Path) -> ForkProcess:
    process = get_context('fork').Process(target=_record, args=(bag, log))
    process.start()
    return process


def _record(bag: Path, log: Path) -> None:
    """Be the pipeline, from now on."""
    with log.open('wb') as stream, open(os.devnull, 'wb') as nothing:
        os.dup2(stream.fileno(), sys.stderr.fileno())
        os.dup2(nothing.fileno(), sys.stdout.fileno())
    os.environ.setdefault('ROS_DOMAIN_ID', _DOMAIN)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    sys.argv = ['pipeline', '--ros-args']
    for parameter in ('source:=simulator', 'duration:=600.0', f'record:={bag}'):
        sys.argv += ['-p', parameter]
    main_of_node('pipeline')


def _await(bag: Path, process: ForkProcess) -> None:
    """Wait until the recording has begun."""
    end = time.monotonic() + _STARTS_WITHIN_S
    while not list(bag.glob('*.mcap')):
        if not process.is_alive() or time.monotonic() > end:
            raise RuntimeError(f'the pipeline did not record (exit code {process.exitcode})')
        time.sleep(_CHECK_S)


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
