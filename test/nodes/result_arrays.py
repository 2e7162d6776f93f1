"""The result arrays of tray 1 that a graph publishes, compared with those of an analysis."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.records import (
    ClusterEstimate,
    CorEstimate,
    CorStatus,
    GroundTruth,
    PairCollision,
    Rebound,
    SpeedEstimate,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array, to_array

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'
TOPICS = {
    SpeedEstimate: topics.SPEED,
    ClusterEstimate: topics.CLUSTER,
    CorEstimate: topics.COR,
    Rebound: topics.REBOUND,
    PairCollision: topics.COLLISION,
}


class ResultArrays:
    """Every result array of tray 1 that was published, by type of record."""

    def __init__(self, node):
        self.messages = defaultdict(list)
        for record_type, topic in {**TOPICS, GroundTruth: topics.TRUTH}.items():
            node.create_subscription(
                Float32MultiArray, topic.of(1), self.messages[record_type].append, qos_of(topic)
            )

    def records(self, record_type):
        return [
            from_array(record_type, message.data, tray=1, epoch_ns=0, where='test')
            for message in self.messages[record_type]
        ]

    def final_cors(self):
        return [cor for cor in self.records(CorEstimate) if cor.status is CorStatus.FINAL]


def offline_arrays():
    """The arrays that the analysis of the sample bag gives."""
    analysis = analyse(SAMPLE, PipelineSettings())
    results = analysis.trays[1]
    by_type = {
        SpeedEstimate: results.speeds,
        ClusterEstimate: results.clusters,
        CorEstimate: results.cors,
        Rebound: results.rebounds,
        PairCollision: results.collisions,
    }
    return {
        record_type: np.array([to_array(record, analysis.epoch_ns) for record in records])
        for record_type, records in by_type.items()
    }


def assert_same_numbers(arrays, rounding, missed=None):
    offline = offline_arrays()
    end = max(rows[:, 0].max() for rows in offline.values())
    for record_type, expected in offline.items():
        messages = arrays.messages[record_type]
        published = np.array([message.data for message in messages], dtype=np.float32)
        assert 30 < len(published) <= len(expected), record_type
        # A listener may be discovered a moment after the first message; from then on every
        # message arrives. What was provisional when the bag ended is final offline alone.
        first = int(np.argmin(np.abs(expected[:, 0] - published[0, 0])))
        assert first <= (len(expected) // 2 if missed is None else missed), record_type
        left = expected[first + len(published) :]
        if record_type in (ClusterEstimate, Rebound, PairCollision):
            # Nodes are not told that the bag has ended; they hold back what may still change.
            assert (left[:, 0] > end - KNOWN_AFTER_NS[record_type] / 1e9).all(), record_type
        else:
            assert len(left) <= 1, record_type
        same = expected[first : first + len(published)]
        # Single precision on the way rounds speeds of contacts: an element near 0, such as a drag
        # or an exponent, differs by a part of what it may be.
        scale = np.nanmax(np.abs(same), axis=0, initial=0.0)
        np.testing.assert_array_less(
            np.abs(published - same)[np.isfinite(same)],
            np.broadcast_to(rounding * scale + 1e-9, same.shape)[np.isfinite(same)],
        )
        np.testing.assert_array_equal(np.isnan(published), np.isnan(same))
