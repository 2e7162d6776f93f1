"""Node: mean projected speeds in, coefficients of restitution with their intervals out."""

from __future__ import annotations

from nanorocks_ros.experiment.settings import PipelineSettings
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.records import SpeedEstimate
from nanorocks_ros.stages.cooling import HaffFitter
from nanorocks_ros.stages.pipeline import trays_of
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.layouts import from_array


class HaffFitterNode(NanorocksNode):
    """Fits Haff's law to the speeds of each tray."""

    # Times are only ever compared with one another, so any epoch does.
    _EPOCH_NS = 0

    def __init__(self):
        super().__init__('haff_fitter')
        self._settings = self.declare(PipelineSettings())
        self._rebuild()
        self.react_to_parameters(self._rebuild)
        for tray in self._settings.trays:
            self.offer((topics.COR,), tray)
            self.listen(topics.SPEED, lambda message, tray=tray: self._take(message, tray), tray)

    def _rebuild(self):
        self._settings = self.current(self._settings)
        trays = trays_of(self._settings)
        self._stages = {n: HaffFitter(self._settings, tray) for n, tray in trays.items()}

    def _take(self, message, tray):
        where = self.resolve_topic_name(topics.SPEED.of(tray))
        speed = from_array(
            SpeedEstimate, message.data, tray=tray, epoch_ns=self._EPOCH_NS, where=where
        )
        for record in self._stages[tray].push(speed):
            self.publish_result(record, self._EPOCH_NS)
