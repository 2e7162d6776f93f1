"""Node: tray images in, mean projected speeds, contacts, bodies and motion masks out."""

from __future__ import annotations

from nanorocks_ros.nodes._tray_stage import TrayStageNode
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.wire import topics


class SpeedEstimatorNode(TrayStageNode):
    """Measures the mean projected speed of each tray, and finds rebounds and collisions."""

    def __init__(self):
        outputs = (topics.SPEED, topics.MOTION, topics.TRACKS)
        outputs = (*outputs, topics.REBOUND, topics.COLLISION, topics.BODIES, topics.MERGE)
        super().__init__('speed_estimator', TrayMeasurement, outputs, in_color=True)

    def prepare(self, stage, tray):
        """Masks and pictures of tracks are made only while somebody looks."""
        stage.emit_mask = self.wanted(topics.MOTION, tray)
        stage.emit_tracks = self.wanted(topics.TRACKS, tray)
