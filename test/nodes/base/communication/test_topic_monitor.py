"""Missing, duplicate and incompatible publishers are reported."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image

from nanorocks_ros.nodes.base.communication.topic_monitor import TopicMonitor
from nanorocks_ros.wire import topics


class NodeOnGraph:
    """A node that sees chosen publishers, where `/clock` is remapped."""

    def __init__(self):
        self.publishers = []
        self.warnings = []

    def create_timer(self, *_, **__):
        return None

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)

    def resolve_topic_name(self, name):
        return '/a' + name

    def count_publishers(self, name):
        return len(self.publishers) if name == '/a/clock' else 0

    def get_publishers_info_by_topic(self, _):
        return [
            SimpleNamespace(node_namespace=space, node_name=name)
            for space, name in self.publishers
        ]


def test_two_publishers_are_named_once_under_the_name_that_they_publish():
    graph = NodeOnGraph()
    monitor = TopicMonitor(graph, clock=None)
    monitor.require_single_publisher('/clock', 'stop one')
    graph.publishers = [('/a', 'player')]
    monitor.problems()
    assert not graph.warnings
    graph.publishers.append(('/', 'other'))
    monitor.problems()
    monitor.problems()
    expected = '/a/clock: published by /a/player and /other, their messages are mixed; stop one'
    assert graph.warnings == [expected]


def test_a_publisher_whose_node_is_not_known_yet_is_waited_for_but_not_for_ever():
    graph = NodeOnGraph()
    monitor = TopicMonitor(graph, clock=None)
    monitor.require_single_publisher('/clock', 'stop one')
    unknown = ('_NODE_NAMESPACE_UNKNOWN_', '_NODE_NAME_UNKNOWN_')
    graph.publishers = [('/a', 'player'), unknown]
    monitor.problems()
    assert not graph.warnings
    for _ in range(10):
        monitor.problems()
    assert len(graph.warnings) == 1


def test_a_camera_or_a_clock_that_nobody_publishes_is_reported(graph):
    process = graph.start('preprocessor', 'use_sim_time:=true')
    for warning in (
        '/nanorocks/camera/image_raw: no publisher within 5 s',
        '/clock: no message within 5 s although use_sim_time is set',
    ):
        graph.until(lambda warning=warning: warning in graph.output(process))
    assert graph.interrupt(process).code == 0


def test_an_incompatible_qos_is_told_while_it_lasts_and_the_advice_removes_it(graph):
    statuses = []
    graph.node.create_subscription(
        DiagnosticArray, '/diagnostics', lambda message: statuses.extend(message.status), 10
    )
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = graph.node.create_publisher(Image, topics.RAW.name, qos)
    process = graph.start('preprocessor')
    graph.until(lambda: 'no data' in graph.output(process))
    (line,) = (line for line in graph.output(process).splitlines() if 'no data' in line)
    assert 'publisher offers reliability BEST_EFFORT but this node requests RELIABLE' in line
    graph.until(lambda: bool(statuses) and statuses[-1].level == DiagnosticStatus.ERROR)
    assert statuses[-1].message in line
    graph.node.destroy_publisher(publisher)
    graph.until(lambda: statuses[-1].level == DiagnosticStatus.WARN)
    assert statuses[-1].message.startswith('no publisher')
    assert graph.interrupt(process).code == 0
    publisher = graph.node.create_publisher(Image, topics.RAW.name, qos)
    (advice,) = re.findall(r'-p (\S+:=\w+)', line)
    process = graph.start('preprocessor', advice)
    graph.until(lambda: publisher.get_subscription_count() == 1)
    assert 'no data' not in graph.output(process)
    assert graph.interrupt(process).code == 0
