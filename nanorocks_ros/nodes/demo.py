"""The demonstration: every node in a process of its own, tray 1, live COR, and a figure.

Run by `make demo`, not by a test.

Tested by ``test/nodes/test_reference.py``.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes.base.epoch import Epoch
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.records import (
    CorEstimate,
    CorStatus,
    GroundTruth,
    SpeedEstimate,
    headline_in_words,
)
from nanorocks_ros.studies.figures.demo_figure import cooling_figure
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

if TYPE_CHECKING:
    from std_msgs.msg import Float32MultiArray

_Record = TypeVar('_Record', SpeedEstimate, CorEstimate, GroundTruth)

_TRAY = 1
_GRAPH = ('preprocessor', 'speed_estimator', 'cluster_autocorrelator', 'haff_fitter', 'simulator')
# All frames from the first one on: the camera starts when three nodes listen.
_SIMULATOR_ARGUMENTS = ('--ros-args', '-p', 'listeners:=3')
_FIGURE = Path('nanorocks_demo.png')
_NODE_ENDS_WITHIN_S = 10.0
# Until the first frame: a first start compiles everything, on a slow machine for many minutes.
_STARTED_WITHIN_S = 1800.0
# From the first frame to the final COR, which takes half a minute where nothing is held up.
_FINAL_WITHIN_S = 360.0
_CHECK_S = 0.5
_FRAMES_PER_LINE = 15


class DemoNode(NanorocksNode):
    """Starts the graph, prints the COR as it converges, draws the final result."""

    def __init__(self) -> None:
        super().__init__('demo')
        self._epoch = Epoch(self, may_set=False)
        self._speeds: list[SpeedEstimate] = []
        self._cors: list[CorEstimate] = []
        self._truth: list[GroundTruth] = []
        self.listen(topics.SPEED, self._receive_speed, _TRAY, required=False)
        self.listen(topics.COR, self._receive_cor, _TRAY, required=False)
        self.listen(topics.TRUTH, self._receive_truth, _TRAY, required=False)
        print(
            f'starting the nodes: {", ".join(_GRAPH)}; the first start on a machine compiles for '
            'minutes',
            flush=True,
        )
        self._deadline = time.monotonic() + _STARTED_WITHIN_S
        self._awaited = f'no frame within {_STARTED_WITHIN_S:g} s'
        self._processes = [_start_node(name) for name in _GRAPH]
        self.create_timer(_CHECK_S, self._check_processes, clock=self.steady_clock)

    def _receive_speed(self, message: Float32MultiArray) -> None:
        if self._epoch.is_known:
            self._speeds.append(_record(SpeedEstimate, message, self._epoch.ns))

    def _receive_truth(self, message: Float32MultiArray) -> None:
        if self._epoch.is_known:
            if not self._truth:
                self._deadline = time.monotonic() + _FINAL_WITHIN_S
                self._awaited = f'no final COR within {_FINAL_WITHIN_S:g} s of the first frame'
            self._truth.append(_record(GroundTruth, message, self._epoch.ns))
            self._print_progress(self._truth[-1])

    def _receive_cor(self, message: Float32MultiArray) -> None:
        if self._epoch.is_known:
            self._cors.append(_record(CorEstimate, message, self._epoch.ns))
            self._print_cor(self._cors[-1])

    def _seconds(self, stamp_ns: int) -> float:
        return (stamp_ns - self._epoch.ns) / 1e9

    def _print_progress(self, truth: GroundTruth) -> None:
        if len(self._truth) % _FRAMES_PER_LINE == 0 and sys.stdout.isatty():
            measured = '  ...'
            if self._speeds:
                measured = f'{self._speeds[-1].mean_projected_speed.value * 1e3:5.2f}'
            seconds = self._seconds(truth.stamp_ns)
            print(f'\r{seconds:5.1f} s  mean speed {measured} mm/s ', end='', flush=True)

    def _print_cor(self, cor: CorEstimate) -> None:
        seconds = self._seconds(cor.stamp_ns)
        if cor.status in (CorStatus.NO_DECAY, CorStatus.UNDETERMINED):
            print(f'\r{seconds:5.1f} s  no COR yet: too little decay         ', flush=True)
            return
        truth = f'  truth {self._truth[-1].restitution:g}' if self._truth else ''
        print(
            f'\r{seconds:5.1f} s  COR {cor.restitution.value:.4f} '
            f'[{cor.restitution.lower:.4f}, {cor.restitution.upper:.4f}] '
            f'{cor.status.name.lower()}{truth}',
            flush=True,
        )
        if cor.status is CorStatus.FINAL:
            self._draw(cor)
            self.done = True

    def _draw(self, final: CorEstimate) -> None:
        cycle = final.cycle
        cooling_figure(
            _FIGURE,
            load_trays()[_TRAY],
            [speed for speed in self._speeds if speed.cycle == cycle],
            [cor for cor in self._cors if cor.cycle == cycle],
            [truth for truth in self._truth if truth.cycle == cycle],
        )
        source = headline_in_words(
            final.headline, final.tension, final.wall_friction, final.quality
        )
        print(
            f'walls {final.wall_restitution.value:.3f} [{final.wall_restitution.lower:.3f}, '
            f"{final.wall_restitution.upper:.3f}]; the paper's closed form says "
            f'{final.paper_restitution:.3f}; from {source}'
        )
        print(f'figure: {_FIGURE.resolve()}', flush=True)

    def _check_processes(self) -> None:
        if time.monotonic() > self._deadline:
            self._fail(f'{self._awaited}; see the messages above')
        for name, process in zip(_GRAPH, self._processes, strict=True):
            if process.poll() is not None:
                self._fail(f'node {name} ended with code {process.returncode}')

    def _fail(self, text: str) -> None:
        print(f'demo: {text}', file=sys.stderr)
        self.exit_code, self.done = 1, True

    def destroy_node(self) -> None:
        """End the nodes that were started, and wait for them."""
        for process in self._processes:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in self._processes:
            try:
                process.wait(_NODE_ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
        super().destroy_node()


def _record(record_type: type[_Record], message: Float32MultiArray, epoch_ns: int) -> _Record:
    return from_array(record_type, message.data, tray=_TRAY, epoch_ns=epoch_ns, where='demo')


def _start_node(name: str) -> subprocess.Popen[bytes]:
    arguments = _SIMULATOR_ARGUMENTS if name == 'simulator' else ()
    # In a session of its own, a Ctrl-C of the terminal reaches it only through `destroy_node`.
    return subprocess.Popen(
        [sys.executable, '-m', 'nanorocks_ros.nodes', name, *arguments],
        env=dict(os.environ, ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST'),
        start_new_session=True,
    )
