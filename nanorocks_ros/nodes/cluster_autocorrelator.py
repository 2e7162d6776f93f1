"""Node: gray tray images in, the width of their autocorrelation out."""

from __future__ import annotations

from nanorocks_ros.nodes._tray_stage import TrayStageNode
from nanorocks_ros.stages.clusters import ClusterAutocorrelator
from nanorocks_ros.stages.warm_up import warm_up_clusters
from nanorocks_ros.wire import topics


class ClusterAutocorrelatorNode(TrayStageNode):
    """Follows the width of the autocorrelation of each tray."""

    def __init__(self):
        outputs = (topics.CLUSTER, topics.AUTOCORRELATION)
        warm_up_clusters()
        super().__init__('cluster_autocorrelator', ClusterAutocorrelator, outputs)

    def prepare(self, stage, tray):
        """The autocorrelation itself is sent only while somebody looks."""
        stage.emit_image = self.wanted(topics.AUTOCORRELATION, tray)
