"""Live graph of the whole plate: eight trays, 1080p, 30 Hz, 60 s: what arrives, and how late.

A film of the plate with all effects is recorded first (LIVE_PLATE_BAG names one that exists:
`nanorocks simulate --scene --bag BAG --duration 65 --first-shake 0.5`). `bag_player` and
`pipeline` run in processes of their own and talk over DDS, once compressed and once raw. A third
process, this one, listens to the truth of a tray (one message a frame sent) and to the state of
each tray (one message a tray image processed) and compares when they came.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

_SECONDS = 60.0
_SETTLE_S = 60.0
_RATE = 30.0
_TRAYS = tuple(range(1, 9))
_DOMAIN = '53'
_TICKS = os.sysconf('SC_CLK_TCK')
_CLI = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'


class _Tally:
    """When each frame was sent and each tray image done, by the number of the frame."""

    def __init__(self, node) -> None:
        from nanorocks_ros.wire import topics

        self.sent: dict[int, float] = {}
        self.done: dict[int, dict[int, float]] = {tray: {} for tray in _TRAYS}
        self.results: dict[str, int] = defaultdict(int)
        node.listen(topics.TRUTH, self._sent, 1, required=False)
        for tray in _TRAYS:
            node.listen(topics.STATE, self._noted(tray), tray, required=False)
            for topic in (topics.SPEED, topics.CLUSTER, topics.COR):
                node.listen(topic, self._counted(tray, topic.name), tray, required=False)

    @staticmethod
    def _frame(message) -> int:
        return round(message.data[0] * _RATE)

    def _sent(self, message) -> None:
        self.sent[self._frame(message)] = time.monotonic()

    def _noted(self, tray: int):
        def note(message) -> None:
            self.done[tray][self._frame(message)] = time.monotonic()

        return note

    def _counted(self, tray: int, name: str):
        def count(_) -> None:
            self.results[f'{name.rpartition("/")[2]} {tray}'] += 1

        return count


def _film(folder: str) -> Path:
    known = os.environ.get('LIVE_PLATE_BAG')
    if known:
        return Path(known)
    bag = Path(folder) / 'plate'
    print(f'filming {_SECONDS:g} s ...', file=sys.stderr, flush=True)
    subprocess.run(
        [sys.executable, '-c', _CLI, 'simulate', '--scene', '--bag', str(bag), '--json',
         '--duration', str(_SECONDS + 5.0), '--first-shake', '0.5', '--effects', 'all'],
        check=True,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    return bag


def _start(*arguments: str) -> subprocess.Popen:
    command = [sys.executable, '-m', 'nanorocks_ros.nodes', *arguments]
    return subprocess.Popen(command)


def _spin(executor, seconds: float, stop=lambda: False) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not stop():
        executor.spin_once(timeout_sec=0.1)


def _cpu(process: subprocess.Popen) -> float:
    """Processor time that a process has used, [s]."""
    try:
        fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return float('nan')
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _run(bag: Path, transport: str) -> None:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from nanorocks_ros.nodes._node import NanorocksNode
    from nanorocks_ros.nodes._shell import message_class, qos_of
    from nanorocks_ros.wire import topics

    node = NanorocksNode('benchmark')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    tally = _Tally(node)
    pipeline = _start(
        'pipeline', '--ros-args', '-p', 'source:=topic', '-p', f'transport:={transport}',
        '-p', f'trays:={list(_TRAYS)}', '-p', 'preprocess.layout:=plate',
        '-p', 'preprocess.pixels_per_metre:=12500.0',
    )  # fmt: skip
    camera = topics.RAW_COMPRESSED if transport == 'compressed' else topics.RAW
    _spin(executor, _SETTLE_S, lambda: node.count_subscribers(camera.absolute()) > 0)
    player = _start(
        'bag_player', '--ros-args', '-p', f'bag:={bag}', '-p', 'listeners:=2',
        '-p', f'duration:={_SECONDS}',
    )  # fmt: skip
    # The player waits for a second listener, which comes when this node hears the truth.
    _spin(executor, _SETTLE_S, lambda: node.count_publishers(topics.TRUTH.absolute(1)) > 0)
    _spin(executor, 2.0)
    gate = node.create_subscription(
        message_class(camera.type), camera.absolute(), lambda _: None, qos_of(camera)
    )
    _spin(executor, _SETTLE_S, lambda: bool(tally.sent))
    node.destroy_subscription(gate)
    before, start = [_cpu(player), _cpu(pipeline)], time.monotonic()
    _spin(executor, _SECONDS - 0.5, lambda: player.poll() is not None)
    used = np.subtract([_cpu(player), _cpu(pipeline)], before) / (time.monotonic() - start)
    _spin(executor, _SETTLE_S, lambda: player.poll() is not None)
    _spin(executor, 1.0)
    pipeline.send_signal(2)
    pipeline.wait(10)
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    _print(tally, used, transport)


def _print(tally: _Tally, used, transport: str) -> None:
    done = {tray: len(tally.sent.keys() & frames.keys()) for tray, frames in tally.done.items()}
    late = [
        1e3 * (max(frames[k] for frames in tally.done.values()) - sent)
        for k, sent in tally.sent.items()
        if all(k in frames for frames in tally.done.values())
    ]
    counts = ', '.join(f'{tray}: {count}' for tray, count in done.items())
    print(f'\n{transport}: frames sent {len(tally.sent)}, all trays done {len(late)}, '
          f'dropped {len(tally.sent) - len(late)}')  # fmt: skip
    print(f'tray images done, by tray: {counts}')
    for name in ('speed', 'cluster', 'cor'):
        found = ', '.join(f'{tray}: {tally.results[f"{name} {tray}"]}' for tray in _TRAYS)
        print(f'results, {name}, by tray: {found}')
    if late:
        print(
            f'latency of the last tray, median {np.median(late):.1f} ms, '
            f'p99 {np.quantile(late, 0.99):.1f} ms, longest {max(late):.1f} ms'
        )
    print(f'CPU while playing: bag_player {used[0]:.2f} cores, pipeline {used[1]:.2f} cores',
          flush=True)  # fmt: skip


def report() -> None:
    """Film the plate, play it, and print what arrived."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = _DOMAIN
    import rclpy

    with tempfile.TemporaryDirectory() as folder:
        bag = _film(folder)
        for transport in ('compressed', 'raw'):
            rclpy.init()
            _run(bag, transport)
