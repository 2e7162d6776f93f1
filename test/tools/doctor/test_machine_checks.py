"""Findings about a machine, with their remedies."""

from __future__ import annotations

import importlib.metadata
import shutil
from collections import namedtuple

import pytest

from nanorocks_ros.tools.doctor import machine_checks, package_checks, ros_checks
from nanorocks_ros.tools.doctor.examination import examine_graph
from nanorocks_ros.tools.doctor.findings import Finding, Status, worst
from nanorocks_ros.tools.doctor.ros_probe_client import loopback_finding

GB = 10**9
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
Usage = namedtuple('Usage', 'total used free')


def with_free(monkeypatch, size):
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: Usage(100 * GB, 0, size))


@pytest.mark.parametrize(
    ('free', 'status'),
    [(20 * GB, Status.OK), (2 * GB, Status.WARNING), (GB // 10, Status.PROBLEM)],
)
def test_a_full_disk_is_found(monkeypatch, free, status):
    with_free(monkeypatch, free)
    assert machine_checks.disk().status is status


def test_the_shared_memory_of_a_container_is_too_small(monkeypatch, tmp_path):
    with_free(monkeypatch, 63_000_000)  # 64 MB, as Docker gives
    finding = machine_checks.shared_memory(tmp_path)
    assert finding.status is Status.PROBLEM
    assert '--shm-size' in finding.remedy


def test_small_socket_buffers_matter_between_machines_only(monkeypatch, tmp_path):
    limit = tmp_path / 'rmem_max'
    limit.write_text('212992\n')
    monkeypatch.setenv(RANGE, 'SUBNET')
    finding = machine_checks.receive_buffer(limit)
    assert finding.status is Status.WARNING
    assert 'sysctl -w net.core.rmem_max=' in finding.remedy
    monkeypatch.setenv(RANGE, 'LOCALHOST')
    assert machine_checks.receive_buffer(limit).status is Status.OK


def test_kernels_that_cannot_be_cached_are_found(monkeypatch, tmp_path):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'new'))
    assert machine_checks.compiled_kernels().status is Status.OK
    (tmp_path / 'file').write_text('')
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'file'))
    finding = machine_checks.compiled_kernels()
    assert finding.status is Status.WARNING
    assert 'NUMBA_CACHE_DIR' in finding.remedy


def test_an_outdated_library_is_named_with_the_required_version(monkeypatch):
    real = importlib.metadata.version
    monkeypatch.setattr(
        importlib.metadata, 'version', lambda name: '0.1' if name == 'mcap' else real(name)
    )
    everything = package_checks.libraries()[0]
    assert everything.status is Status.PROBLEM
    assert 'mcap 0.1 is not >=1.2.1' in everything.found
    assert everything.remedy == "pip install 'mcap>=1.2.1'"


def test_a_missing_extra_is_a_warning_with_its_purpose(monkeypatch):
    real = importlib.metadata.version

    def version(name):
        if name == 'pyarrow':
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(importlib.metadata, 'version', version)
    findings = {library.name: library for library in package_checks.libraries()}
    assert findings['extra [parquet]'].status is Status.WARNING
    assert '.parquet' in findings['extra [parquet]'].found
    assert findings['libraries'].status is Status.OK


@pytest.mark.parametrize(
    ('value', 'status'),
    [('', Status.OK), ('42', Status.OK), ('150', Status.WARNING), ('-1', Status.PROBLEM)],
)
def test_an_invalid_domain_is_found(monkeypatch, value, status):
    monkeypatch.setenv('ROS_DOMAIN_ID', value)
    assert ros_checks.domain().status is status


@pytest.mark.parametrize(
    ('value', 'status'),
    [('LOCALHOST', Status.OK), ('localhost', Status.WARNING), ('OFF', Status.PROBLEM)],
)
def test_the_discovery_range_is_checked(monkeypatch, value, status):
    monkeypatch.delenv('ROS_LOCALHOST_ONLY', raising=False)
    monkeypatch.setenv(RANGE, value)
    assert ros_checks.discovery().status is status


def test_a_missing_profile_is_a_problem(monkeypatch):
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', '/no/such/profile.xml')
    finding = ros_checks.profile()
    assert finding.status is Status.PROBLEM
    assert '/no/such/profile.xml' in finding.found


def test_executables_are_found_as_ros2_run_finds_them(monkeypatch, tmp_path):
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/no/such/prefix:{tmp_path}')
    assert ros_checks.executables(('pipeline',)).status is Status.WARNING
    index = tmp_path / 'share/ament_index/resource_index/packages'
    index.mkdir(parents=True)
    (index / 'nanorocks_ros').touch()
    programs = tmp_path / 'lib/nanorocks_ros'
    programs.mkdir(parents=True)
    (programs / 'pipeline').touch(mode=0o755)
    assert ros_checks.executables(('pipeline',)).status is Status.OK
    (programs / 'demo').touch(mode=0o644)
    assert 'demo cannot be run' in ros_checks.executables(('pipeline', 'demo')).found


def test_the_worst_finding_is_the_verdict():
    ok, warning = Finding(name='a', found=''), Finding(name='b', found='', status=Status.WARNING)
    assert worst([]) is Status.OK
    assert worst([ok, warning]) is Status.WARNING
    assert worst([warning, Finding(name='c', found='', status=Status.PROBLEM)]) is Status.PROBLEM


def test_two_cameras_on_one_topic_are_found():
    topic = {
        'name': '/nanorocks/camera/image_raw',
        'types': ['sensor_msgs/msg/Image'],
        'publishers': [{'node': '/nanorocks/simulator'}, {'node': '/nanorocks/bag_player'}],
        'subscriptions': [{'node': '/nanorocks/preprocessor'}],
        'mismatches': [],
    }
    (finding,) = examine_graph([topic])
    assert finding.status is Status.WARNING
    assert 'frames of 2 cameras are mixed' in finding.found


def test_results_of_two_pipelines_on_one_topic_are_found():
    topic = {
        'name': '/lab/tray_3/speed',
        'types': ['std_msgs/msg/Float32MultiArray'],
        'publishers': [{'node': '/lab/pipeline'}, {'node': '/lab/speed_estimator'}],
        'subscriptions': [{'node': '/lab/dashboard'}],
        'mismatches': [],
    }
    (finding,) = examine_graph([topic])
    assert finding.status is Status.WARNING
    assert 'results of 2 nodes are mixed' in finding.found
    (other,) = examine_graph([{**topic, 'name': '/lab/chatter'}])
    assert other.status is Status.OK


def test_an_empty_graph_names_the_variables_to_compare():
    (finding,) = examine_graph([])
    assert finding.status is Status.WARNING
    assert 'ROS_DOMAIN_ID' in finding.remedy


@pytest.mark.parametrize(
    ('sent', 'received', 'named'),
    [(0, 0, 'did not discover each other'), (5, 3, '3 of 5 frames')],
)
def test_frames_that_do_not_arrive_are_a_problem(sent, received, named):
    finding = loopback_finding(
        'frames',
        {'sent': sent, 'frame_bytes': 100},
        {'received': received, 'bytes': 100 * received, 'seconds': 0.1},
    )
    assert finding.status is Status.PROBLEM
    assert named in finding.found
    assert finding.remedy
