"""``nanorocks doctor`` with real ROS nodes, which it asks through the probe."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from doctor_table import assert_documented

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, String

from nanorocks_ros.nodes.base.communication.ros_messages import image_message, qos_of
from nanorocks_ros.nodes.base.communication.typed_messages import typed_problem
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

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


def assert_told(fault, check):
    assert_documented(fault, check['status'], check['found'], check['remedy'] or '')


def test_frames_are_sent_and_counted(graph):
    code, checks = doctor(graph, AMENT_PREFIX_PATH=sys.prefix)
    assert code == 0, checks
    assert '5 of 5 frames' in checks['frames over loopback']['found']
    assert checks['rclpy']['status'] == 'ok'
    assert checks['Fast DDS profile']['status'] == 'ok'
    assert checks['executables']['status'] == 'ok'
    if typed_problem():
        assert_told('no typed messages', checks['typed messages'])


def test_what_does_not_connect_is_listed_and_the_advice_connects_it(graph):
    graph.node.create_publisher(Float32MultiArray, 'tray_1/speed', BEST_EFFORT)
    graph.node.create_publisher(Float32MultiArray, 'tray_2/cor', RELIABLE)
    graph.node.create_subscription(Float32MultiArray, 'tray_2/cor', print, BEST_EFFORT)
    graph.node.create_subscription(Float32MultiArray, 'tray_3/cor', print, RELIABLE)
    graph.node.create_publisher(String, 'tray_4/speed', RELIABLE)
    graph.node.create_publisher(Time, 'epoch', RELIABLE)
    node = graph.start_program('cluster_autocorrelator', 'trays:=[1, 4]')
    graph.until(lambda: 'publishes std_msgs/msg/String' in graph.output(node))
    code, checks = doctor(graph, '--graph')
    assert code == 1
    fine, alone = (checks[f'/nanorocks/tray_{k}/cor'] for k in (2, 3))
    deaf, other_type = (checks[f'/nanorocks/tray_{k}/speed'] for k in (1, 4))
    early = checks['/nanorocks/epoch']
    assert_told('an incompatible quality of service', deaf)
    assert_told('an incompatible quality of service', early)
    assert_told('a publisher of another type', other_type)
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
    node = graph.start_program(
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


def test_a_middleware_that_is_not_there_is_named_and_the_advice_removes_it(graph):
    code, checks = doctor(graph, RMW_IMPLEMENTATION='rmw_none_cpp')
    assert code == 1
    assert_told('the middleware is not there', checks['rclpy'])
    assert checks['rclpy']['remedy'].startswith('unset RMW_IMPLEMENTATION (')
    code, checks = doctor(graph, RMW_IMPLEMENTATION='')
    assert code == 0
    assert checks['rclpy']['status'] == 'ok'


def test_a_graph_that_works_has_no_finding_but_its_state(graph):
    """Neither a camera without camera_info nor a pipeline without a truth is a fault."""
    start_camera(graph)
    graph.start_program('pipeline', 'source:=topic')
    name = graph.node.resolve_topic_name(topics.SPEED.of(1))
    graph.until(lambda: graph.node.count_publishers(name) == 1)
    checks = until_told(graph, lambda checks: '/nanorocks/pipeline' in checks)
    connections = {name: check for name, check in checks.items() if name.count('/') > 2}
    assert '/nanorocks/camera/camera_info' in connections
    assert all(check['status'] == 'ok' for check in connections.values()), connections


def start_camera(graph):
    graph.start_program('simulator', 'width_px:=240', 'height_px:=240', 'frame_rate:=10.0')


def until_told(graph, holds):
    """Ask until it holds: nodes are discovered and report within seconds."""
    for _ in range(6):
        _, checks = doctor(graph, '--graph')
        if holds(checks):
            return checks
    pytest.fail(f'never told: {checks}')


def test_a_camera_of_another_name_is_found_and_heard_as_advised(graph):
    graph.node.create_publisher(Image, '/cam0/image', qos_of(topics.RAW))
    node = graph.start_program('preprocessor')
    raw = graph.node.resolve_topic_name(topics.RAW.name)
    graph.until(lambda: graph.node.count_subscribers(raw) == 1)
    checks = until_told(graph, lambda checks: raw in checks and '/cam0/image' in checks)
    assert_told('a camera of another name', checks[raw])
    graph.interrupt(node)
    _, *advice = re.findall(r'with --ros-args (-r) (\S+)', checks[raw]['remedy'])[0]
    graph.start_program('preprocessor', arguments=('-r', *advice))
    graph.until(lambda: graph.node.count_subscribers('/cam0/image') == 1)
    checks = until_told(graph, lambda checks: '/cam0/image' in checks)
    assert raw not in checks
    assert checks['/cam0/image']['status'] == 'ok'


def test_a_node_in_another_domain_is_named_and_heard_as_advised(graph):
    other = str(graph.domain % 100 + 1)
    node = graph.start_program('haff_fitter')
    name = graph.node.resolve_topic_name(topics.COR.of(1))
    graph.until(lambda: graph.node.count_publishers(name) == 1)
    named = f'haff_fitter (process {node.pid})'
    _, checks = doctor(graph, '--graph', ROS_DOMAIN_ID=other)
    assert_told('another domain', checks[named])
    (advice,) = re.findall(r'export ROS_DOMAIN_ID=(\d+)', checks[named]['remedy'])
    _, checks = doctor(graph, '--graph', ROS_DOMAIN_ID=advice)
    assert named not in checks
    assert '/nanorocks/haff_fitter' in checks


def test_what_a_node_says_of_its_camera_is_told_by_the_doctor_too(graph):
    camera = graph.node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
    node = graph.start_program('preprocessor')
    graph.until(lambda: camera.get_subscription_count() == 1)
    told = {}

    def until_said(fault, words):
        check = until_told(
            graph,
            lambda checks: words in checks.get('/nanorocks/preprocessor', {}).get('found', ''),
        )['/nanorocks/preprocessor']
        assert_told(fault, check)
        told[fault] = check

    until_said('the camera is silent', 'no frame for')
    pixels = np.zeros((240, 240), np.uint16)
    camera.publish(image_message(NS, 'camera', pixels, 'bayer_rggb16'))
    until_said('the camera sends another encoding', 'bayer_rggb16')
    gray = np.full((240, 240), 80, np.uint8)
    for stamp_ns in (2 * NS, 3 * NS, 2_000_000_000 * NS, 4 * NS):
        camera.publish(image_message(stamp_ns, 'camera', gray, 'mono8'))
    until_said('stamps of another clock', 'stamp')
    node.send_signal(signal.SIGSTOP)
    named = f'preprocessor (process {node.pid})'
    assert_told('a node hangs', until_told(graph, lambda checks: named in checks)[named])
    node.send_signal(signal.SIGCONT)
    assert graph.interrupt(node).code == 0
    assert len(told) == 3
