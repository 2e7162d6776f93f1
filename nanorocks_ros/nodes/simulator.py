"""Node: one simulated tray, or the whole plate, filmed by a simulated camera, and the truth."""

from __future__ import annotations

from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.nodes._pacing import Pacer
from nanorocks_ros.nodes._scene import SimulatedScene
from nanorocks_ros.nodes._sources import Simulated, publish_moment
from nanorocks_ros.settings import (
    FilmSettings,
    PacingSettings,
    SceneSettings,
    SimulationSettings,
)
from nanorocks_ros.wire import topics


class SimulatorNode(NanorocksNode):
    """Publishes synthetic frames and their truth at the pace of a camera."""

    def __init__(self):
        super().__init__('simulator')
        settings = self.declare(SimulationSettings())
        pacing = self.declare(PacingSettings())
        chosen = self.declare(FilmSettings())
        scene = self.declare(SceneSettings(), 'scene.')
        self._epoch = Epoch(self, may_set=True, follow=False)
        self.offer((topics.EPOCH, topics.RAW))
        self.watch.alone_on(topics.RAW.name)
        if chosen.whole_scene:
            self._simulated = SimulatedScene(self, settings, scene, chosen.effects)
        else:
            self.offer((topics.TRUTH,), settings.tray)
            self._simulated = Simulated(self, settings, '')
        self._publish = self._simulated.publish if chosen.whole_scene else self._publish_tray
        self._pacer = Pacer(self, self._simulated.moments(), self._emit, pacing, self.finish)

    def _emit(self, _, moment):
        dated = self._simulated.dated(moment)
        if self._epoch.ns is None:
            self._epoch.set(dated[0].stamp_ns)
        self._publish(dated, self._epoch.ns)
        self._pacer.takers.sent(dated[0].stamp_ns)

    def _publish_tray(self, moment, epoch_ns):
        publish_moment(self, moment, epoch_ns)
