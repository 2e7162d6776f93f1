"""Publishes records as a node does, and receives them typed: a process with nanorocks_msgs."""

from __future__ import annotations

import sys
import time

import numpy as np
import rclpy
from nanorocks_msgs import msg as typed

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of, stamp_of
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.records import (
    CorEstimate,
    CorRelation,
    CorStatus,
    Interval,
    Measured,
    Merge,
    Quality,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.wire.products import ARRAY_TOPICS, TYPED_TOPICS

EPOCH = 1_700_000_000_000_000_000
LATER = EPOCH + 3 * 86_400 * 10**9 + 123_456_789
RECORDS = (
    SpeedEstimate(
        stamp_ns=LATER,
        tray=3,
        cycle=2,
        cycle_start_ns=None,
        mean_projected_speed=Measured(4.5e-3, 1e-4),
        window=0.2,
        method=SpeedMethod.TRACKING,
        quality=Quality.GLARE | Quality.FEW_BEADS,
    ),
    CorEstimate(
        stamp_ns=LATER,
        tray=3,
        cycle=1,
        status=CorStatus.FINAL,
        relation=CorRelation.LIBRARY,
        restitution=Interval(0.9, 0.85, 0.95),
        samples=120,
    ),
    Merge(
        stamp_ns=LATER,
        known_ns=LATER + 10**9,
        tray=3,
        cycle=2,
        tracks=np.array([3, 11], dtype=np.int32),
        joins=True,
    ),
)


def main() -> None:
    """Print `complete` when all typed messages are right."""
    rclpy.init()
    node = NanorocksNode('typed')
    received = {}
    node.outputs.offer([ARRAY_TOPICS[type(record)] for record in RECORDS], tray=3)
    for record in RECORDS:
        topic = TYPED_TOPICS[type(record)]
        kind = getattr(typed, type(record).__name__)
        node.create_subscription(
            kind, topic.of(3), lambda m, kind=kind: received.update({kind: m}), qos_of(topic)
        )
    end = time.monotonic() + 30
    while len(received) < len(RECORDS) and time.monotonic() < end:
        for record in RECORDS:
            node.outputs.publish_result(record, EPOCH)
        rclpy.spin_once(node, timeout_sec=0.2)
    speed, cor, merge = (received[getattr(typed, type(record).__name__)] for record in RECORDS)
    assert stamp_of(speed.header.stamp) == LATER
    assert speed.header.frame_id == 'tray_3'
    assert abs(speed.time - (LATER - EPOCH) / 1e9) < 1e-9
    assert np.isnan(speed.cycle_start)
    assert (speed.method, speed.method_name) == (typed.SpeedEstimate.TRACKING, 'tracking')
    assert list(speed.quality_names) == ['few_beads', 'glare']
    assert (cor.status, cor.status_name, cor.relation_name) == (2, 'final', 'library')
    assert np.isclose([cor.restitution, cor.restitution_upper], [0.9, 0.95]).all()
    assert cor.samples == 120
    assert (merge.track_1, merge.track_2, merge.joins) == (3, 11, True)
    print('complete')
    sys.stdout.flush()


if __name__ == '__main__':
    main()
