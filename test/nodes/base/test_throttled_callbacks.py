"""Callbacks of a throttled group run only after it was opened."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes.base.throttled_callbacks import ThrottledCallbacks


def test_callbacks_run_only_once_the_group_is_open(spun):
    node, spin_until = spun
    group, calls = ThrottledCallbacks(), []
    timer = node.create_timer(0.001, lambda: calls.append(1), callback_group=group)
    others = []
    node.create_timer(0.001, lambda: others.append(1))
    spin_until(lambda: len(others) > 20)
    assert not calls
    group.open()
    spin_until(lambda: bool(calls))
    timer.cancel()
