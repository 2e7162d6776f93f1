"""Records that are published as images, and all topics of results.

Tested by ``test/nodes/base/test_publishing.py``.
"""

from __future__ import annotations

from nanorocks_ros.records import Autocorrelation, MotionMask, TrayImage
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.products import ARRAY_TOPICS

IMAGE_TOPICS: dict[type, tuple[tuple[topics.Topic, str], ...]] = {
    TrayImage: ((topics.GRAY, 'gray'), (topics.RECTIFIED, 'color')),
    MotionMask: ((topics.MOTION, 'mask'),),
    Autocorrelation: ((topics.AUTOCORRELATION, 'values'),),
}
"""Records that travel as images: topic and field."""

RESULT_TOPICS = (
    *(topic for topic in ARRAY_TOPICS.values() if topic is not topics.TRUTH),
    topics.TRACKS,
    *(topic for pairs in IMAGE_TOPICS.values() for topic, _ in pairs),
)
"""Everything that the pipeline measures of a tray."""
