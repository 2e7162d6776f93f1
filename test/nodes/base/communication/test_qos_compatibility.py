"""Every policy by which publishers offer less than subscriptions request is named."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from nanorocks_ros.nodes.base.communication.qos_compatibility import mismatches


def test_every_policy_that_does_not_match_is_named():
    weak = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    strong = QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    assert mismatches([strong], [weak]) == []
    assert mismatches([weak, weak, strong], [strong]) == [
        ('reliability', 'BEST_EFFORT', 'RELIABLE'),
        ('durability', 'VOLATILE', 'TRANSIENT_LOCAL'),
    ]
