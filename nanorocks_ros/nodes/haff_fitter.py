"""Node: speeds and contacts in, coefficients of restitution with their intervals out."""

from __future__ import annotations

from functools import partial

from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.warm_up import warm_up_cooling
from nanorocks_ros.records import Merge, PairCollision, Rebound, SpeedEstimate
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array


class HaffFitterNode(NanorocksNode):
    """Reads restitutions from the speeds and contacts of each tray."""

    _INPUTS = (
        (topics.SPEED, SpeedEstimate),
        (topics.REBOUND, Rebound),
        (topics.COLLISION, PairCollision),
        (topics.MERGE, Merge),
    )
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
            for topic, record in self._INPUTS:
                take = partial(self._take, topic, record, tray)
                # Without tracks there are speeds, but no contacts.
                self.listen(topic, take, tray, required=record is SpeedEstimate)

    def _build(self, settings):
        return {
            number: RestitutionEstimator(settings, tray)
            for number, tray in trays_of(settings).items()
        }

    def _adopt(self, settings, stages):
        self._settings, self._stages = settings, stages

    def _take(self, topic, kind, tray, message):
        where = self.resolve_topic_name(topic.of(tray))
        taken = from_array(kind, message.data, tray=tray, epoch_ns=self._EPOCH_NS, where=where)
        for record in self._stages[tray].push(taken):
            self.publish_result(record, self._EPOCH_NS)
