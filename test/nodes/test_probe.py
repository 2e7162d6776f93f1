"""``nanorocks doctor`` with real ROS nodes, which it asks through the probe."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

pytest.importorskip('rclpy')

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


def test_incompatible_endpoints_are_listed(graph):
    graph.node.create_publisher(Float32MultiArray, 'tray_1/cor', BEST_EFFORT)
    graph.node.create_subscription(Float32MultiArray, 'tray_1/cor', print, RELIABLE)
    graph.node.create_publisher(Float32MultiArray, 'tray_2/cor', RELIABLE)
    graph.node.create_subscription(Float32MultiArray, 'tray_2/cor', print, BEST_EFFORT)
    graph.node.create_subscription(Float32MultiArray, 'tray_3/cor', print, RELIABLE)
    graph.node.create_publisher(String, 'tray_4/speed', RELIABLE)
    fitter = graph.start('haff_fitter', 'trays:=[4]')
    graph.until(lambda: 'publishes std_msgs/msg/String' in graph.output(fitter))
    code, checks = doctor(graph, '--graph')
    assert code == 1
    deaf, fine, alone = (checks[f'/nanorocks/tray_{k}/cor'] for k in (1, 2, 3))
    other_type = checks['/nanorocks/tray_4/speed']
    assert deaf['status'] == 'problem'
    assert 'no data: /nanorocks/listener -> /nanorocks/listener' in deaf['found']
    assert 'reliab' in deaf['found'].lower()
    assert 'qos_overrides./nanorocks/tray_1/cor.subscription' in deaf['remedy']
    assert fine['status'] == 'ok'
    assert other_type['status'] == 'problem'
    assert 'the types differ: std_msgs/msg/String, std_msgs' in other_type['found']
    assert other_type['remedy'].startswith('remap the topic')
    assert alone['status'] == 'warning'
    assert 'no node -> /nanorocks/listener' in alone['found']
    assert not any('doctor' in check['found'] for check in checks.values())


def test_a_ros_that_does_not_load_is_a_problem_told_in_one_line(graph, tmp_path):
    (tmp_path / 'rclpy').mkdir()
    (tmp_path / 'rclpy' / '__init__.py').write_text("raise ImportError('librcl.so: not there')")
    paths = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    code, checks = doctor(graph, PYTHONPATH=paths)
    assert code == 1
    assert checks['rclpy']['status'] == 'problem'
    assert checks['rclpy']['found'].endswith('ImportError: librcl.so: not there')
    assert 'frames over loopback' not in checks
