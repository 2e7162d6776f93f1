"""Node: gray tray images, bodies and speeds in; clusters and where beads begin to stick out."""

from __future__ import annotations

from functools import partial

from nanorocks_ros.nodes._tray_stage import TrayStageNode
from nanorocks_ros.pipeline.warm_up import warm_up_clusters
from nanorocks_ros.records import BodyEstimate, Merge, SpeedEstimate
from nanorocks_ros.stages.clusters.cluster_estimator import ClusterEstimator
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array


class ClusterAutocorrelatorNode(TrayStageNode):
    """Follows the clusters of each tray: by the autocorrelation, and by what tracks say."""

    _FROM_TRACKS = (
        (topics.SPEED, SpeedEstimate),
        (topics.BODIES, BodyEstimate),
        (topics.MERGE, Merge),
    )

    def __init__(self):
        outputs = (topics.CLUSTER, topics.AUTOCORRELATION)
        warm_up_clusters()
        super().__init__('cluster_autocorrelator', ClusterEstimator, outputs)
        for tray in self._settings.trays:
            for topic, record in self._FROM_TRACKS:
                # Without a speed estimator clusters are known by their autocorrelation alone.
                take = partial(self._take, topic, record, tray)
                self.listen(topic, take, tray, required=False)

    def prepare(self, stage, tray):
        """The autocorrelation itself is sent only while somebody looks."""
        stage.emit_image = self.wanted(topics.AUTOCORRELATION, tray)

    def _take(self, topic, kind, tray, message):
        self._epoch.when_known(None, partial(self._join, topic, kind, tray), message)

    def _join(self, topic, kind, tray, message):
        where = self.resolve_topic_name(topic.of(tray))
        taken = from_array(kind, message.data, tray=tray, epoch_ns=self._epoch.ns, where=where)
        self._stages[tray].push(taken)
