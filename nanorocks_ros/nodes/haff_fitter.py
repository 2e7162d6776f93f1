"""Node: speeds and contacts in, coefficients of restitution with their intervals out."""

from __future__ import annotations

from collections import deque
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
    from nanorocks_ros.stages.restitution.restitution_estimator import (
        RestitutionEstimator,
        RestitutionInput,
    )
    from nanorocks_ros.wire.topics import Topic

    Estimators = dict[int, RestitutionEstimator | ContactEstimator]

# Of each topic on which a message waits the executor takes one, in this order: speeds last.
_INPUTS = (
    (topics.REBOUND, Rebound),
    (topics.COLLISION, PairCollision),
    (topics.FLIGHT, FreeFlight),
    (topics.MERGE, Merge),
    (topics.SPEED, SpeedEstimate),
)
# Until speeds that wait are looked at again [s].
_LOOK_AGAIN_S = 0.02
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
        self._waiting = {tray: WaitingSpeeds() for tray in self._settings.trays}
        self._timer = self.create_timer(_LOOK_AGAIN_S, self._look_again, clock=self.steady_clock)
        self._timer.cancel()
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
        waiting = self._waiting[tray]
        if not isinstance(record, SpeedEstimate):
            waiting.contact_came()
            self._push(tray, record)
            return
        waiting.append(record)
        self._push_speeds(tray)
        if waiting:
            self._timer.reset()

    def _look_again(self) -> None:
        for tray in self._waiting:
            self._push_speeds(tray)
        if not any(self._waiting.values()):
            self._timer.cancel()

    def _push_speeds(self, tray: int) -> None:
        for speed in self._waiting[tray].taken():
            self._push(tray, speed)

    def _push(self, tray: int, record: RestitutionInput) -> None:
        for result in self._stages[tray].push(record):
            self.outputs.publish_result(result, _EPOCH_NS)


class WaitingSpeeds:
    """Speeds that wait until the contacts before them are in.

    Where a node falls behind, messages wait on all of its topics, and one of each is taken in
    turn: speeds overtake the contacts, which are more. As long as contacts come with every speed
    there may be more of them.
    """

    def __init__(self) -> None:
        self._speeds: deque[SpeedEstimate] = deque()
        self._came = False

    def __bool__(self) -> bool:
        return bool(self._speeds)

    def append(self, speed: SpeedEstimate) -> None:
        """Add a speed."""
        self._speeds.append(speed)

    def contact_came(self) -> None:
        """Note that a contact was taken."""
        self._came = True

    def taken(self) -> list[SpeedEstimate]:
        """The speeds that wait no longer: all of them, if no contact came since the last call."""
        came, self._came = self._came, False
        if came:
            return []
        speeds = list(self._speeds)
        self._speeds.clear()
        return speeds
