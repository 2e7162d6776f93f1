"""``nanorocks doctor`` with real ROS nodes, which it asks through the probe."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float32MultiArray, String

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
COMMAND = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main(sys.argv[1:]))'


def doctor(graph, *arguments, **variables):
    finished = subprocess.run(
        [sys.executable, '-c', COMMAND, 'doctor', '--json', *arguments],
        env={**os.environ, 'ROS_DOMAIN_ID': str(graph.domain), **variables},
        capture_output=True,
        text=True,
        timeout=120,
    )
    checks = json.loads(finished.stdout)['checks']
    return finished.returncode, {check['name']: check for check in checks}


def test_frames_are_sent_and_counted(graph):
    code, checks = doctor(graph, AMENT_PREFIX_PATH=sys.prefix)
    assert code == 0, checks
    assert '5 of 5 frames' in checks['frames over loopback']['found']
    assert checks['rclpy']['status'] == 'ok'
    assert checks['Fast DDS profile']['status'] == 'ok'
    assert checks['executables']['status'] == 'ok'


def test_what_does_not_connect_is_listed_and_the_advice_connects_it(graph):
    graph.node.create_publisher(Float32MultiArray, 'tray_1/speed', BEST_EFFORT)
    graph.node.create_publisher(Float32MultiArray, 'tray_2/cor', RELIABLE)
    graph.node.create_subscription(Float32MultiArray, 'tray_2/cor', print, BEST_EFFORT)
    graph.node.create_subscription(Float32MultiArray, 'tray_3/cor', print, RELIABLE)
    graph.node.create_publisher(String, 'tray_4/speed', RELIABLE)
    graph.node.create_publisher(Time, 'epoch', RELIABLE)
    node = graph.start('cluster_autocorrelator', 'trays:=[1, 4]')
    graph.until(lambda: 'publishes std_msgs/msg/String' in graph.output(node))
    code, checks = doctor(graph, '--graph')
    assert code == 1
    fine, alone = (checks[f'/nanorocks/tray_{k}/cor'] for k in (2, 3))
    deaf, other_type = (checks[f'/nanorocks/tray_{k}/speed'] for k in (1, 4))
    early = checks['/nanorocks/epoch']
    assert deaf['status'] == early['status'] == other_type['status'] == 'problem'
    assert 'no data: /nanorocks/listener -> /nanorocks/cluster_autocorrelator' in deaf['found']
    assert 'reliab' in deaf['found'].lower()
    assert 'transient local' in early['found'].lower()
    assert fine['status'] == 'ok'
    assert 'the types differ: std_msgs/msg/String, std_msgs' in other_type['found']
    assert alone['status'] == 'warning'
    assert 'no node -> /nanorocks/listener' in alone['found']
    assert not any('doctor' in check['found'] for check in checks.values())
    graph.interrupt(node)
    # As it is advised: an override of one policy each, and another name for one topic.
    advised = [
        word
        for check in (deaf, early)
        for word in re.findall(r'qos_overrides\S+:=\w+', check['remedy'])
    ]
    assert len(advised) == 2
    (rename,) = re.findall(r'-r (\S+:=/\w+)', other_type['remedy'])
    node = graph.start(
        'cluster_autocorrelator', 'trays:=[1, 4]', *advised, arguments=('-r', rename)
    )
    name = graph.node.resolve_topic_name('tray_1/speed')
    graph.until(lambda: graph.node.count_subscribers(name) == 1)
    _, checks = doctor(graph, '--graph')
    assert checks['/nanorocks/tray_1/speed']['status'] == 'ok'
    assert checks['/nanorocks/epoch']['status'] == 'ok'
    assert checks['/nanorocks/tray_4/speed']['status'] == 'ok'
    assert graph.interrupt(node).code == 0


def test_a_ros_that_does_not_load_is_a_problem_told_in_one_line(graph, tmp_path):
    (tmp_path / 'rclpy').mkdir()
    (tmp_path / 'rclpy' / '__init__.py').write_text("raise ImportError('librcl.so: not there')")
    paths = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    code, checks = doctor(graph, PYTHONPATH=paths)
    assert code == 1
    assert checks['rclpy']['status'] == 'problem'
    assert checks['rclpy']['found'].endswith('ImportError: librcl.so: not there')
    assert 'frames over loopback' not in checks
