"""Node: results in, the live page out.

A process of its own, so that no browser slows the graph; it publishes nothing but diagnostics.
"""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray

from nanorocks_ros.dashboard.board import Board
from nanorocks_ros.dashboard.server import PageServer
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.trays.viewed_images import ViewedImages
from nanorocks_ros.records import GroundTruth
from nanorocks_ros.settings import DashboardGraphSettings, DashboardSettings
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array
from nanorocks_ros.wire.products import CURVES

if TYPE_CHECKING:
    from std_msgs.msg import Float32MultiArray

    from nanorocks_ros.wire.topics import Topic

_RESULTS = tuple(
    (product.topic, product.record) for product in CURVES.values() if product.measured
)
_TRAYS = range(1, 9)
_DISCOVERY_S = 0.25
# The truth comes with every frame; a curve needs no more than this of it.
_TRUTH_PAUSE_S = 0.3
# Times are only compared with each other, so any epoch does.
_EPOCH_NS = 0


class DashboardNode(NanorocksNode):
    """Passes results and diagnostics to the page, and images while somebody views them."""

    subscribes_later = True

    def __init__(self) -> None:
        super().__init__('dashboard')
        settings = self.parameters.declare(DashboardSettings())
        graph = self.parameters.declare(DashboardGraphSettings())
        self._parent = graph.parent
        self._followed: set[int] = set()
        board = Board(load_trays(graph.trays_file), settings.kept_cycles)
        self._server = PageServer(settings, board, self.get_namespace())
        self._images = ViewedImages(self, self._server.show, 1.0 / settings.picture_rate)
        self._server.start()
        # Printed, not logged: logs are kept, and the token may be in the address.
        print(f'dashboard: the live page is at {self._server.url}', flush=True)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._receive_diagnostics, 50)
        self.create_timer(_DISCOVERY_S, self._discover, clock=self.steady_clock)

    def _discover(self) -> None:
        """Follow new trays and views; end with the parent."""
        for tray in _TRAYS:
            published = any(self.count_publishers(topic.of(tray)) for topic, _ in _RESULTS)
            if published and tray not in self._followed:
                self._follow(tray)
        self._images.follow(self._server.wanted)
        self.diagnostics.values['browsers'] = self._server.clients
        if self._parent and os.getppid() != self._parent:
            self.done = True

    def _follow(self, tray: int) -> None:
        self._followed.add(tray)
        self._server.expect(tray)
        for topic, record_type in _RESULTS:
            receive = partial(self._receive, topic, record_type, tray)
            self.listen(topic, receive, tray, required=False)
        receive_truth = partial(self._receive, topics.TRUTH, GroundTruth, tray)
        self._images.subscribe_throttled(topics.TRUTH, tray, receive_truth, _TRUTH_PAUSE_S)

    def _receive(
        self, topic: Topic, record_type: type[Any], tray: int, message: Float32MultiArray
    ) -> None:
        where = self.resolve_topic_name(topic.of(tray))
        self._server.take(
            from_array(record_type, message.data, tray=tray, epoch_ns=_EPOCH_NS, where=where)
        )

    def _receive_diagnostics(self, message: DiagnosticArray) -> None:
        self._server.diagnose(
            [
                (
                    status.name,
                    int.from_bytes(status.level, 'little'),
                    status.message,
                    [(pair.key, pair.value) for pair in status.values],
                )
                for status in message.status
            ]
        )

    def destroy_node(self) -> None:
        """End the server before the node."""
        self._server.stop()
        super().destroy_node()
