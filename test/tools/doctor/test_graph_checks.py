"""Findings about a running graph, from what the probe lists."""

from __future__ import annotations

from doctor_table import assert_documented

from nanorocks_ros.tools.doctor.findings import Status
from nanorocks_ros.tools.doctor.graph_checks import examine_graph
from nanorocks_ros.tools.doctor.node_processes import NodeProcess

IMAGE = 'sensor_msgs/msg/Image'
ELSEWHERE = NodeProcess(7, 'pipeline', {'ROS_DOMAIN_ID': '77'})


def answer(*listed, reports=()):
    return {'topics': list(listed), 'reports': list(reports)}


def listed(name, publishers=(), subscriptions=(), types=(IMAGE,)):
    return {
        'name': name,
        'types': list(types),
        'publishers': [{'node': node} for node in publishers],
        'subscriptions': [{'node': node} for node in subscriptions],
        'mismatches': [],
    }


def assert_told(fault, finding):
    assert_documented(fault, finding.status.value, finding.found, finding.remedy)


def test_two_cameras_on_one_topic_are_found():
    topic = {
        'name': '/nanorocks/camera/image_raw',
        'types': ['sensor_msgs/msg/Image'],
        'publishers': [{'node': '/nanorocks/simulator'}, {'node': '/nanorocks/bag_player'}],
        'subscriptions': [{'node': '/nanorocks/preprocessor'}],
        'mismatches': [],
    }
    (finding,) = examine_graph(answer(topic), [])
    assert_told('two cameras', finding)


def test_results_of_two_pipelines_on_one_topic_are_found():
    topic = {
        'name': '/lab/tray_3/speed',
        'types': ['std_msgs/msg/Float32MultiArray'],
        'publishers': [{'node': '/lab/pipeline'}, {'node': '/lab/speed_estimator'}],
        'subscriptions': [{'node': '/lab/dashboard'}],
        'mismatches': [],
    }
    (finding,) = examine_graph(answer(topic), [])
    assert_told('two pipelines', finding)
    (other,) = examine_graph(answer({**topic, 'name': '/lab/chatter'}), [])
    assert other.status is Status.OK


def test_an_empty_graph_names_the_variables_to_compare():
    (finding,) = examine_graph(answer(), [])
    assert_told('no node', finding)


def test_a_graph_in_another_namespace_is_started_there():
    topic = listed('/lab/a/tray_3/speed', subscriptions=['/lab/a/dashboard'])
    (finding,) = examine_graph(answer(topic), [])
    assert finding.remedy == 'ros2 run nanorocks_ros pipeline --ros-args -r __ns:=/lab/a'
    (finding,) = examine_graph(answer({**topic, 'name': '/nanorocks/tray_3/speed'}), [])
    assert_told('nobody publishes a result', finding)


def test_a_camera_is_told_by_the_name_that_a_driver_publishes_it_under():
    wanted = listed('/nanorocks/camera/image_raw', subscriptions=['/nanorocks/pipeline'])
    driver = listed('/cam0/image', publishers=['/cam0/driver'])
    # A picture of our own is no camera, and what somebody hears is not lost.
    own = listed('/nanorocks/tray_1/motion', publishers=['/nanorocks/pipeline'])
    heard = listed('/a/image', publishers=['/a/driver'], subscriptions=['/viewer'])
    told = examine_graph(answer(heard, own, driver, wanted), [])[-1]
    assert_told('a camera of another name', told)
    assert told.remedy.endswith('-r /nanorocks/camera/image_raw:=/cam0/image')
    told = examine_graph(answer(heard, own, wanted), [])[-1]
    assert_told('no camera', told)


def test_what_a_graph_does_without_is_no_fault():
    info = listed('/nanorocks/camera/camera_info', subscriptions=['/nanorocks/pipeline'] * 2)
    (finding,) = examine_graph(answer(info), [])
    assert finding.status is Status.OK
    assert finding.found == 'no node -> /nanorocks/pipeline'


def test_every_problem_of_a_node_is_a_finding_with_its_remedy():
    report = {
        'node': '/nanorocks/pipeline',
        'level': 2,
        'message': '/x: no frame; start the camera',
        'further': ['the disk is low; make room; or record elsewhere'],
    }
    first, second = examine_graph(answer(reports=[report]), [])
    assert first.status is Status.PROBLEM
    assert (first.found, first.remedy) == ('/x: no frame', 'start the camera')
    assert second.status is Status.WARNING
    assert second.remedy == 'make room; or record elsewhere'


def test_a_graph_elsewhere_is_a_warning_only_where_this_one_lacks_something():
    camera = listed('/nanorocks/camera/image_raw', subscriptions=['/nanorocks/pipeline'])
    assert examine_graph(answer(camera), [ELSEWHERE])[0].status is Status.WARNING
    (finding,) = examine_graph(answer(), [ELSEWHERE])
    assert_told('another domain', finding)
    camera = listed('/nanorocks/camera/image_raw', ['/nanorocks/simulator'])
    assert examine_graph(answer(camera), [ELSEWHERE])[0].status is Status.OK


def test_a_node_that_runs_and_does_not_report_is_told(monkeypatch):
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'RMW_IMPLEMENTATION'):
        monkeypatch.delenv(name, raising=False)
    report = {'node': '/lab/pipeline', 'level': 0, 'message': 'working', 'further': []}
    processes = [NodeProcess(7, 'pipeline', {}), NodeProcess(8, 'haff_fitter', {})]
    fine, silent = examine_graph(answer(reports=[report]), processes)
    assert fine.status is Status.OK
    assert_told('a node hangs', silent)
    assert silent.name == 'haff_fitter (process 8)'
    renamed = NodeProcess(8, 'haff_fitter', {}, is_renamed=True)
    assert len(examine_graph(answer(reports=[report]), [processes[0], renamed])) == 1
    # Two of the same name, of which the probe keeps one report.
    both = [NodeProcess(pid, 'pipeline', {}) for pid in (7, 8)]
    sent = listed('/diagnostics', ['/lab/pipeline', '/lab/pipeline'], types=['Diagnostics'])
    assert len(examine_graph(answer(sent, reports=[report]), both)) == 1
