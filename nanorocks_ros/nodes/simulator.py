"""Node: a simulated tray filmed by a simulated camera, with the truth beside it."""

from __future__ import annotations

from nanorocks_ros.experiment.settings import PacingSettings, SimulationSettings
from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.nodes._pacing import Pacer
from nanorocks_ros.nodes._sources import Simulated, publish_moment
from nanorocks_ros.wire import topics


class SimulatorNode(NanorocksNode):
    """Publishes synthetic frames and their truth at the pace of a camera."""

    def __init__(self):
        super().__init__('simulator')
        settings = self.declare(SimulationSettings())
        pacing = self.declare(PacingSettings())
        self._epoch = Epoch(self, may_set=True, follow=False)
        self.offer((topics.EPOCH, topics.RAW, topics.TRUTH), settings.tray)
        self._simulated = Simulated(self, settings, '')
        self._pacer = Pacer(self, self._simulated.moments(), self._emit, pacing, self.finish)

    def _emit(self, _, moment):
        frame, truth = self._simulated.dated(moment)
        if self._epoch.ns is None:
            self._epoch.set(frame.stamp_ns)
        publish_moment(self, (frame, truth), self._epoch.ns)
