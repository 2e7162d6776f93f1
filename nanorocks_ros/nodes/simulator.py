"""Node: one simulated tray, or the whole plate, filmed by a simulated camera, and the truth.

Tested by ``test/nodes/test_graph.py``.
"""

from __future__ import annotations

from typing import Any

from nanorocks_ros.nodes.base.epoch import Epoch
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.sources.player import Player
from nanorocks_ros.nodes.sources.simulated_scene import SimulatedScene
from nanorocks_ros.nodes.sources.simulated_tray import SimulatedTray
from nanorocks_ros.settings import (
    FilmSettings,
    PacingSettings,
    SceneSettings,
    SimulationSettings,
)
from nanorocks_ros.wire import topics


class SimulatorNode(NanorocksNode):
    """Publishes synthetic frames and their truth at the pace of a camera."""

    def __init__(self) -> None:
        super().__init__('simulator')
        simulation = self.parameters.declare(SimulationSettings())
        pacing = self.parameters.declare(PacingSettings())
        film = self.parameters.declare(FilmSettings())
        scene = self.parameters.declare(SceneSettings(), 'scene.')
        self._epoch = Epoch(self, may_set=True, follow=False)
        self.outputs.offer((topics.EPOCH, topics.RAW))
        self.topic_monitor.require_single_publisher(topics.RAW.name)
        self._source: SimulatedScene | SimulatedTray
        if film.whole_scene:
            self._source = SimulatedScene(self, simulation, scene, film.effects)
        else:
            self.outputs.offer((topics.TRUTH,), simulation.tray)
            self._source = SimulatedTray(self, simulation, trays_file='')
        self._player = Player(self, self._source.moments(), self._emit, pacing, self.finish)

    def _emit(self, _: int, moment: Any) -> None:
        stamped: Any = self._source.stamped(moment)
        stamp_ns = stamped.frame.stamp_ns
        if not self._epoch.is_known:
            self._epoch.set(stamp_ns)
        self._source.publish(stamped, self._epoch.ns)
        self._player.flow_control.note_sent(stamp_ns)
