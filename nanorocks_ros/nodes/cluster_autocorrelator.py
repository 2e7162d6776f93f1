"""Node: gray tray images, bodies and speeds in, estimates of the clusters out.

Tested by ``test/nodes/test_graph.py``.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from nanorocks_ros.nodes.trays.tray_stage_node import TrayStageNode
from nanorocks_ros.pipeline.changed_settings import Part
from nanorocks_ros.pipeline.warm_up import warm_up_clusters
from nanorocks_ros.records import BodyEstimate, Merge, PairCollision, SpeedEstimate
from nanorocks_ros.stages.clusters.cluster_estimator import ClusterEstimator
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

if TYPE_CHECKING:
    from std_msgs.msg import Float32MultiArray

    from nanorocks_ros.wire.topics import Topic

_OUTPUTS = (topics.CLUSTER, topics.AUTOCORRELATION)
_FROM_TRACKS = (
    (topics.SPEED, SpeedEstimate),
    (topics.BODIES, BodyEstimate),
    (topics.MERGE, Merge),
    (topics.COLLISION, PairCollision),
)


class ClusterAutocorrelatorNode(TrayStageNode):
    """Estimates the clusters of each tray from the autocorrelation and from the tracks."""

    def __init__(self) -> None:
        warm_up_clusters()
        super().__init__('cluster_autocorrelator', ClusterEstimator, _OUTPUTS, part=Part.CLUSTERS)
        for tray in self._settings.trays:
            for topic, record_type in _FROM_TRACKS:
                # Without a speed estimator the autocorrelation alone gives the clusters.
                receive = partial(self._receive_array, topic, record_type, tray)
                self.listen(topic, receive, tray, required=False)

    def select_images(self, stage: Any, tray: int) -> None:
        """The autocorrelation itself is published only while somebody subscribes."""
        stage.emit_image = self.outputs.has_subscribers(topics.AUTOCORRELATION, tray)

    def _receive_array(
        self, topic: Topic, record_type: type[Any], tray: int, message: Float32MultiArray
    ) -> None:
        push = partial(self._push_array, topic, record_type, tray)
        self._epoch.when_known(None, push, message)

    def _push_array(
        self, topic: Topic, record_type: type[Any], tray: int, message: Float32MultiArray
    ) -> None:
        where = self.resolve_topic_name(topic.of(tray))
        epoch_ns = self._epoch.ns
        record = from_array(record_type, message.data, tray=tray, epoch_ns=epoch_ns, where=where)
        self._stages[tray].push(record)
