"""Which record is published on which topic.

Tested by test/nodes/base/test_publishing.py.
"""

from __future__ import annotations

from nanorocks_ros.records import (
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    CorEstimate,
    GroundTruth,
    Merge,
    MotionMask,
    PairCollision,
    Rebound,
    SpeedEstimate,
    TrayImage,
)
from nanorocks_ros.wire import topics

ARRAY_TOPICS: dict[type, topics.Topic] = {
    SpeedEstimate: topics.SPEED,
    ClusterEstimate: topics.CLUSTER,
    CorEstimate: topics.COR,
    Rebound: topics.REBOUND,
    PairCollision: topics.COLLISION,
    BodyEstimate: topics.BODIES,
    Merge: topics.MERGE,
    GroundTruth: topics.TRUTH,
}
"""Records that travel as arrays."""

IMAGE_TOPICS: dict[type, tuple[tuple[topics.Topic, str], ...]] = {
    TrayImage: ((topics.GRAY, 'gray'), (topics.RECTIFIED, 'color')),
    MotionMask: ((topics.MOTION, 'mask'),),
    Autocorrelation: ((topics.AUTOCORRELATION, 'values'),),
}
"""Records that travel as images: topic and field."""

RESULT_TOPICS = (
    *ARRAY_TOPICS.values(),
    topics.STATE,
    topics.TRACKS,
    *(topic for pairs in IMAGE_TOPICS.values() for topic, _ in pairs),
)
"""Everything that the pipeline publishes of a tray."""
