"""The demonstration: every node in a process of its own, tray 1, live COR, and a figure."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.records import CorEstimate, CorStatus, GroundTruth, SpeedEstimate
from nanorocks_ros.studies.figures.demo_figure import cooling_figure
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

_TRAY = 1
_GRAPH = ('preprocessor', 'speed_estimator', 'cluster_autocorrelator', 'haff_fitter', 'simulator')
# All frames, from the first: the nodes listen before the camera starts.
_SIMULATOR = ('--ros-args', '-p', 'listeners:=3')
_FIGURE = Path('nanorocks_demo.png')
_NODE_ENDS_WITHIN_S = 10.0
# The first time all is compiled, on a slow machine for minutes.
_DEADLINE_S = 360.0


class DemoNode(NanorocksNode):
    """Starts the graph, prints the COR as it converges, draws the end result."""

    def __init__(self):
        super().__init__('demo')
        self._epoch = Epoch(self, may_set=False)
        self._records = {SpeedEstimate: [], CorEstimate: [], GroundTruth: []}
        for topic, kind in (
            (topics.SPEED, SpeedEstimate),
            (topics.COR, CorEstimate),
            (topics.TRUTH, GroundTruth),
        ):
            self.listen(topic, lambda m, kind=kind: self._take(kind, m), _TRAY, required=False)
        print('starting the nodes: ' + ', '.join(_GRAPH), flush=True)
        self._deadline = time.monotonic() + _DEADLINE_S
        self._processes = [_started(name) for name in _GRAPH]
        self.create_timer(0.5, self._watch, clock=self.steady_clock)

    def _take(self, kind, message):
        if self._epoch.ns is None:
            return
        record = from_array(kind, message.data, tray=_TRAY, epoch_ns=self._epoch.ns, where='demo')
        self._records[kind].append(record)
        if kind is GroundTruth:
            self._print_progress(record)
        if kind is CorEstimate:
            self._print_cor(record)

    def _print_progress(self, truth):
        if len(self._records[GroundTruth]) % 15 == 0 and sys.stdout.isatty():
            seconds = (truth.stamp_ns - self._epoch.ns) / 1e9
            speeds = self._records[SpeedEstimate]
            measured = f'{speeds[-1].mean_projected_speed.value * 1e3:5.2f}' if speeds else '  ...'
            print(f'\r{seconds:5.1f} s  mean speed {measured} mm/s ', end='', flush=True)

    def _print_cor(self, cor):
        truth = self._records[GroundTruth]
        seconds = (cor.stamp_ns - self._epoch.ns) / 1e9
        known = f'  truth {truth[-1].restitution:g}' if truth else ''
        if cor.status in (CorStatus.NO_DECAY, CorStatus.UNDETERMINED):
            print(f'\r{seconds:5.1f} s  the decay tells too little yet      ', flush=True)
            return
        print(
            f'\r{seconds:5.1f} s  COR {cor.restitution.value:.4f} '
            f'[{cor.restitution.lower:.4f}, {cor.restitution.upper:.4f}] '
            f'{cor.status.name.lower()}{known}',
            flush=True,
        )
        if cor.status is CorStatus.FINAL:
            self._draw()
            self.done = True

    def _draw(self):
        cycle = self._records[CorEstimate][-1].cycle
        of_cycle = {
            kind: [one for one in found if one.cycle == cycle]
            for kind, found in self._records.items()
        }
        cooling_figure(
            _FIGURE,
            load_trays()[_TRAY],
            of_cycle[SpeedEstimate],
            of_cycle[CorEstimate],
            of_cycle[GroundTruth],
        )
        last = self._records[CorEstimate][-1]
        print(
            f'walls {last.wall_restitution.value:.3f} [{last.wall_restitution.lower:.3f}, '
            f"{last.wall_restitution.upper:.3f}]; the paper's closed form says "
            f'{last.paper_restitution:.3f}; see docs/method/restitution.md'
        )
        print(f'figure: {_FIGURE.resolve()}', flush=True)

    def _watch(self):
        if time.monotonic() > self._deadline:
            print('demo: no final COR in time; see what the nodes said above', file=sys.stderr)
            self.exit_code, self.done = 1, True
        for name, process in zip(_GRAPH, self._processes, strict=True):
            if process.poll() is not None:
                print(f'demo: node {name} ended with code {process.returncode}', file=sys.stderr)
                self.exit_code = 1
                self.done = True

    def destroy_node(self):
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


def _started(name):
    arguments = _SIMULATOR if name == 'simulator' else ()
    # A session of its own, so that a Ctrl-C here reaches it once, from us.
    return subprocess.Popen(
        [sys.executable, '-m', 'nanorocks_ros.nodes', name, *arguments],
        env=dict(os.environ, ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST'),
        start_new_session=True,
    )
