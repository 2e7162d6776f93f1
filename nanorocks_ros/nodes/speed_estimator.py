"""Node: tray images in, mean projected speeds, contacts, bodies and motion masks out.

Tested by ``test/nodes/test_graph.py``.
"""

from __future__ import annotations

from typing import Any

from nanorocks_ros.nodes.trays.tray_stage_node import TrayStageNode
from nanorocks_ros.pipeline.changed_settings import Part
from nanorocks_ros.pipeline.open_trays import measurement_of
from nanorocks_ros.wire import topics

_OUTPUTS = (
    topics.SPEED,
    topics.MOTION,
    topics.TRACKS,
    topics.REBOUND,
    topics.COLLISION,
    topics.FLIGHT,
    topics.BODIES,
    topics.MERGE,
)


class SpeedEstimatorNode(TrayStageNode):
    """Measures the mean projected speed of each tray, and finds rebounds and collisions."""

    def __init__(self) -> None:
        super().__init__(
            'speed_estimator', measurement_of, _OUTPUTS, part=Part.MEASUREMENT, in_color=True
        )

    def select_images(self, stage: Any, tray: int) -> None:
        """Masks and images of tracks are made only while somebody subscribes."""
        stage.emit_mask = self.outputs.has_subscribers(topics.MOTION, tray)
        stage.emit_tracks = self.outputs.has_subscribers(topics.TRACKS, tray)
