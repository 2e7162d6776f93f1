"""Node: mean projected speeds in, coefficients of restitution with their intervals out."""

from __future__ import annotations

from nanorocks_ros.experiment.settings import PipelineSettings
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.records import SpeedEstimate
from nanorocks_ros.stages.cooling import HaffFitter
from nanorocks_ros.stages.pipeline import trays_of
from nanorocks_ros.stages.warm_up import warm_up_cooling
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.layouts import from_array


class HaffFitterNode(NanorocksNode):
    """Reads restitutions from the speeds of each tray."""

    # Times are only ever compared with one another, so any epoch does.
    _EPOCH_NS = 0

    def __init__(self):
        super().__init__('haff_fitter')
        self._settings = self.declare(PipelineSettings(), fixed=False)
        self._adopt(self._settings, self._build(self._settings))
        self.react_to_parameters(PipelineSettings(), self._build, self._adopt)
        for tray in self._settings.trays:
            self.offer((topics.COR,), tray)
        # Others find the publishers meanwhile.
        warm_up_cooling()
        for tray in self._settings.trays:
            self.listen(topics.SPEED, lambda message, tray=tray: self._take(message, tray), tray)

    def _build(self, settings):
        return {number: HaffFitter(settings, one) for number, one in trays_of(settings).items()}

    def _adopt(self, settings, stages):
        self._settings, self._stages = settings, stages

    def _take(self, message, tray):
        where = self.resolve_topic_name(topics.SPEED.of(tray))
        speed = from_array(
            SpeedEstimate, message.data, tray=tray, epoch_ns=self._EPOCH_NS, where=where
        )
        for record in self._stages[tray].push(speed):
            self.publish_result(record, self._EPOCH_NS)
