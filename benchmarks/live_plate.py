"""Live graph of the whole plate: received frames and latency of eight trays, 1080p, 30 Hz.

A film of the plate with all effects is recorded first (LIVE_PLATE_BAG names an existing one:
`nanorocks simulate --scene --bag BAG --duration 65 --first-shake 0.5`). `bag_player` and
`pipeline` run in separate processes and communicate over DDS. A third process, this one, receives
the truth of a tray (one message per frame sent) and the state of each tray (one message per tray
image processed), and compares their times of arrival.

The film is played compressed, raw, and compressed with all options: the pipeline records camera
and results, and serves the live page to ten browsers that view a tray with tracks and moving
areas. LIVE_PLATE_RUNS selects from `compressed raw everything`, LIVE_PLATE_SECONDS sets the
duration (60), LIVE_PLATE_BROWSERS the number of browsers (10).
"""

from __future__ import annotations

import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from nanorocks_ros.records import GroundTruth, TrayState
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.wire.array_layouts import layout

_SECONDS = float(os.environ.get('LIVE_PLATE_SECONDS', '60'))
_RUNS = os.environ.get('LIVE_PLATE_RUNS', 'compressed raw everything').split()
_BROWSERS = int(os.environ.get('LIVE_PLATE_BROWSERS', '10'))
_SETTLE_S = 60.0
_SLOW_MS = 500.0
_QUIET_S = 3.0
_RATE = 30.0
_TRAYS = tuple(range(1, 9))
PLATE = {
    'trays': _TRAYS,
    'preprocess.layout': 'plate',
    'preprocess.pixels_per_metre': 12500.0,
}
"""Settings for films of the plate."""
_DOMAIN = '53'
_TICKS = os.sysconf('SC_CLK_TCK')
_CLI = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'


class _Tally:
    """Times at which each frame was sent and each tray image was processed, by frame number.

    Only the time in a message is unpacked, to leave the cores to the measured processes.
    """

    def __init__(self, node) -> None:
        from nanorocks_ros.wire import topics

        self._node = node
        self.last = time.monotonic()
        self.sent: dict[int, float] = {}
        self.done: dict[int, dict[int, float]] = {tray: {} for tray in _TRAYS}
        self.results: dict[str, int] = defaultdict(int)
        self._listen(topics.TRUTH, 1, self._noted(self.sent, GroundTruth))
        for tray in _TRAYS:
            self._listen(topics.STATE, tray, self._noted(self.done[tray], TrayState))
            for topic in (topics.SPEED, topics.CLUSTER, topics.COR):
                self._listen(topic, tray, self._counted(tray, topic.name))

    def _listen(self, topic, tray: int, take) -> None:
        from nanorocks_ros.nodes.base.communication.ros_messages import message_class, qos_of

        kind = message_class(topic.type)
        self._node.create_subscription(kind, topic.of(tray), take, qos_of(topic), raw=True)

    def _noted(self, times: dict[int, float], kind):
        # A message ends with the values; the time is the first of them.
        values_size = 4 * len(layout(kind).elements)

        def record_time(cdr: bytes) -> None:
            now = self.last = time.monotonic()
            (seconds,) = struct.unpack_from('<f', cdr, len(cdr) - values_size)
            times[round(seconds * _RATE)] = now

        return record_time

    def _counted(self, tray: int, name: str):
        def count(_) -> None:
            self.results[f'{name.rpartition("/")[2]} {tray}'] += 1

        return count


def filmed_plate(folder: str, seconds: float, existing: str) -> Path:
    """A film of the plate with all effects: an existing or a new one."""
    if existing:
        return Path(existing)
    bag = Path(folder) / 'plate'
    print(f'filming {seconds:g} s ...', file=sys.stderr, flush=True)
    subprocess.run(
        [sys.executable, '-c', _CLI, 'simulate', '--scene', '--bag', str(bag), '--json',
         '--duration', str(seconds), '--first-shake', '0.5', '--effects', 'all'],
        check=True,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    return bag


def _start(cleanup: ExitStack, *arguments: str) -> subprocess.Popen:
    command = [sys.executable, '-m', 'nanorocks_ros.nodes', *arguments]
    process = subprocess.Popen(command)
    # The process ends even after an exception here.
    cleanup.callback(process.kill)
    return process


def _spin(executor, seconds: float, stop=lambda: False) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and not stop():
        executor.spin_once(timeout_sec=0.1)


def _cpu(process: subprocess.Popen) -> float:
    """Processor time that a process and its children have used, [s]."""
    return sum(_cpu_of(member) for member in _family(process.pid))


def _family(pid: int) -> list[int]:
    try:
        children = Path(f'/proc/{pid}/task/{pid}/children').read_text().split()
    except OSError:
        children = []
    return [pid, *(descendant for child in children for descendant in _family(int(child)))]


def _cpu_of(pid: int) -> float:
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return float('nan')
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _free_port() -> int:
    with socket.socket() as server:
        server.bind(('127.0.0.1', 0))
        return int(server.getsockname()[1])


def _browsers(port: int) -> subprocess.Popen:
    call = f'from benchmarks.dashboard import browse; browse({port}, {_BROWSERS}, 0, {_SECONDS})'
    return subprocess.Popen([sys.executable, '-c', call], stdout=subprocess.PIPE)


def _run(bag: Path, run: str, folder: str, cleanup: ExitStack) -> None:
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor

    from nanorocks_ros.nodes.base.communication.ros_messages import message_class, qos_of
    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.wire import topics

    node = NanorocksNode('benchmark')
    executor = EventsExecutor()
    executor.add_node(node)
    tally = _Tally(node)
    everything, record, port = run == 'everything', f'{folder}/recorded', _free_port()
    transport = 'compressed' if everything else run
    everything_options = [
        '-p',
        f'record:={record}',
        '-p',
        'dashboard:=true',
        '-p',
        f'dashboard_port:={port}',
    ]
    pipeline = _start(
        cleanup, 'pipeline', '--ros-args', '-p', 'source:=topic', '-p', f'transport:={transport}',
        '-p', f'trays:={list(_TRAYS)}', '-p', 'preprocess.layout:=plate',
        '-p', 'preprocess.pixels_per_metre:=12500.0', *(everything_options if everything else ()),
    )  # fmt: skip
    camera = topics.RAW_COMPRESSED if transport == 'compressed' else topics.RAW
    _spin(executor, _SETTLE_S, lambda: node.count_subscribers(camera.absolute()) > 0)
    browsers = _browsers(port) if everything else None
    player = _start(
        cleanup, 'bag_player', '--ros-args', '-p', f'bag:={bag}', '-p', 'listeners:=2',
        '-p', f'duration:={_SECONDS}',
    )  # fmt: skip
    # The player waits for a second subscriber, which is made once the truth is offered.
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
    # Frames in queues still arrive.
    _spin(executor, _SETTLE_S, lambda: time.monotonic() - tally.last > _QUIET_S)
    pipeline.send_signal(2)
    pipeline.wait(20)
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    _print(tally, used, run)
    if browsers is not None:
        steps, pictures = json.loads(browsers.communicate()[0])
        print(f'each of {_BROWSERS} browsers: {steps:.1f} steps/s, {pictures:.1f} pictures/s')
        print(f'frames recorded: {BagFrames(record).count}')


def _print(tally: _Tally, used, run: str) -> None:
    done = {tray: len(tally.sent.keys() & frames.keys()) for tray, frames in tally.done.items()}
    first = min(tally.sent)
    late, lost = {}, []
    for frame, sent in sorted(tally.sent.items()):
        second = (frame - first) / _RATE
        if all(frame in frames for frames in tally.done.values()):
            late[second] = 1e3 * (max(value[frame] for value in tally.done.values()) - sent)
        else:
            lost.append(second)
    counts = ', '.join(f'{tray}: {count}' for tray, count in done.items())
    print(f'\n{run}: frames sent {len(tally.sent)}, all trays done {len(late)}, '
          f'dropped {len(lost)}{_when(lost)}')  # fmt: skip
    print(f'tray images done, by tray: {counts}')
    for name in ('speed', 'cluster', 'cor'):
        counts_text = ', '.join(f'{tray}: {tally.results[f"{name} {tray}"]}' for tray in _TRAYS)
        print(f'results, {name}, by tray: {counts_text}')
    if late:
        ms = list(late.values())
        print(
            f'latency of the last tray, median {np.median(ms):.1f} ms, '
            f'p99 {np.quantile(ms, 0.99):.1f} ms, longest {max(ms):.1f} ms'
        )
        slow = [second for second, value in late.items() if value > _SLOW_MS]
        print(f'later than {_SLOW_MS:g} ms: {len(slow)}{_when(slow)}')
    print(f'CPU while playing: bag_player {used[0]:.2f} cores, pipeline {used[1]:.2f} cores',
          flush=True)  # fmt: skip


def _when(seconds: list[float]) -> str:
    """Text with the time spans of events less than a second apart."""
    if not seconds:
        return ''
    gaps = np.flatnonzero(np.diff(seconds) > 1.0) + 1
    spans = np.split(np.array(seconds), gaps)
    return ', at ' + ', '.join(f'{span[0]:.1f} to {span[-1]:.1f} s' for span in spans)


def report() -> None:
    """Film the plate, play it, and print the received frames."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = _DOMAIN
    import rclpy

    with tempfile.TemporaryDirectory() as folder:
        bag = filmed_plate(folder, _SECONDS + 5.0, os.environ.get('LIVE_PLATE_BAG', ''))
        for run in _RUNS:
            rclpy.init()
            with ExitStack() as cleanup:
                _run(bag, run, folder, cleanup)
