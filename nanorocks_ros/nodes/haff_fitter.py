"""Node: speeds and contacts in, coefficients of restitution with their intervals out."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from nanorocks_ros.nodes.base.communication.topic_monitor import ONE_SOURCE
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.base.parameters import CYCLE_GOES_ON
from nanorocks_ros.nodes.base.told_settings import default_settings
from nanorocks_ros.pipeline.changed_settings import Part, changed_parts
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.open_trays import estimator_of
from nanorocks_ros.pipeline.warm_up import warm_up_cooling
from nanorocks_ros.records import FreeFlight, Merge, PairCollision, Rebound, SpeedEstimate
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

if TYPE_CHECKING:
    from std_msgs.msg import Float32MultiArray

    from nanorocks_ros.stages.contact_restitution.contact_estimator import ContactEstimator
    from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator
    from nanorocks_ros.wire.topics import Topic

    Estimators = dict[int, RestitutionEstimator | ContactEstimator]

_INPUTS = (
    (topics.SPEED, SpeedEstimate),
    (topics.REBOUND, Rebound),
    (topics.COLLISION, PairCollision),
    (topics.FLIGHT, FreeFlight),
    (topics.MERGE, Merge),
)
# Times are only compared with each other, so any epoch does.
_EPOCH_NS = 0


class HaffFitterNode(NanorocksNode):
    """Estimates the restitution of each tray from its speeds and contacts."""

    def __init__(self) -> None:
        super().__init__('haff_fitter')
        self._settings = self.parameters.declare(default_settings(self), read_only=False)
        self._stages = self._build(self._settings)
        self.diagnostics.note_priors(self._settings.prior)
        self.parameters.react_to_changes(self._settings, self._build, self._change)
        for tray in self._settings.trays:
            self.outputs.offer((topics.COR,), tray)
            self.topic_monitor.require_single_publisher(topics.COR.of(tray), ONE_SOURCE)
        # Meanwhile others discover the publishers.
        warm_up_cooling()
        for tray in self._settings.trays:
            for topic, record_type in _INPUTS:
                receive = partial(self._receive, topic, record_type, tray)
                # Without tracks there are speeds, but no contacts.
                self.listen(topic, receive, tray, required=record_type is SpeedEstimate)

    def _build(self, settings: PipelineSettings) -> Estimators:
        return {
            number: estimator_of(settings, tray) for number, tray in trays_of(settings).items()
        }

    def _change(self, before: PipelineSettings, after: PipelineSettings, _: Estimators) -> str:
        if Part.RESTITUTION in changed_parts(before, after):
            for stage in self._stages.values():
                stage.adopt(after)
            self.diagnostics.note_priors(after.prior)
        return CYCLE_GOES_ON

    def _receive(
        self, topic: Topic, record_type: type[Any], tray: int, message: Float32MultiArray
    ) -> None:
        where = self.resolve_topic_name(topic.of(tray))
        record = from_array(record_type, message.data, tray=tray, epoch_ns=_EPOCH_NS, where=where)
        for result in self._stages[tray].push(record):
            self.outputs.publish_result(result, _EPOCH_NS)
