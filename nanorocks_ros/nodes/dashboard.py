"""Node: results in, the live page out.

A process of its own, so that no browser slows the graph; it publishes its diagnostics alone.
"""

from __future__ import annotations

import os
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray

from nanorocks_ros.dashboard.board import Board
from nanorocks_ros.dashboard.server import PageServer
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes._looks import Looks
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.records import GroundTruth
from nanorocks_ros.settings import DashboardGraphSettings, DashboardSettings
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array
from nanorocks_ros.wire.products import CURVES

_RESULTS = tuple(
    (product.topic, product.record) for product in CURVES.values() if product.measured
)
_TRAYS = range(1, 9)
_LOOK_AROUND_S = 0.25
# The truth comes with every frame; a line needs no more than this of it.
_TRUTH_EVERY_S = 0.3
# Times are only compared with one another, so any epoch does.
_EPOCH_NS = 0


class DashboardNode(NanorocksNode):
    """Hands results and diagnostics to the page, and pictures while somebody looks."""

    hears_much = True

    def __init__(self):
        super().__init__('dashboard')
        settings = self.declare(DashboardSettings())
        graph = self.declare(DashboardGraphSettings())
        self._parent = graph.parent
        self._followed = set()
        board = Board(load_trays(graph.trays_file))
        self._server = PageServer(settings, board, self.get_namespace())
        self._looks = Looks(self, self._server.show, 1.0 / settings.picture_rate)
        self._server.start()
        # Not to the log, which is kept: the token may be in it.
        print(f'dashboard: the live page is at {self._server.url}', flush=True)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._diagnose, 50)
        self.create_timer(_LOOK_AROUND_S, self._look_around, clock=self.steady_clock)

    def _look_around(self):
        for tray in _TRAYS:
            found = any(self.count_publishers(topic.of(tray)) for topic, _ in _RESULTS)
            if found and tray not in self._followed:
                self._follow(tray)
        self._looks.follow(self._server.wanted)
        self.state['browsers'] = self._server.clients
        if self._parent and os.getppid() != self._parent:
            self.done = True

    def _follow(self, tray):
        self._followed.add(tray)
        self._server.expect(tray)
        for topic, kind in _RESULTS:
            self.listen(topic, partial(self._take, topic, kind, tray), tray, required=False)
        truth = partial(self._take, topics.TRUTH, GroundTruth, tray)
        self._looks.sample(topics.TRUTH, tray, truth, _TRUTH_EVERY_S)

    def _take(self, topic, kind, tray, message):
        where = self.resolve_topic_name(topic.of(tray))
        self._server.take(
            from_array(kind, message.data, tray=tray, epoch_ns=_EPOCH_NS, where=where)
        )

    def _diagnose(self, message):
        self._server.diagnose(
            [
                (
                    one.name,
                    int.from_bytes(one.level, 'little'),
                    one.message,
                    [(pair.key, pair.value) for pair in one.values],
                )
                for one in message.status
            ]
        )

    def destroy_node(self):
        """End the server first: it has nothing to tell any more."""
        self._server.stop()
        super().destroy_node()
