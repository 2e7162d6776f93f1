"""The order of the checks, and where they end."""

from __future__ import annotations

import importlib.util

from nanorocks_ros.tools.doctor.examination import examine
from nanorocks_ros.tools.doctor.findings import Status


def test_without_ros_the_checks_end_with_it(monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, 'find_spec', lambda name: None if name == 'rclpy' else find_spec(name)
    )
    announced = []
    findings = list(examine(announced.append))
    names = [finding.name for finding in findings]
    assert names[:2] == ['Python', 'libraries']
    assert names[-3:] == ['disk', 'live page', 'ROS 2']
    assert findings[-1].status is Status.PROBLEM
    assert not announced
