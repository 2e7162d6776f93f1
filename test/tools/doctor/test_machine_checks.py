"""Findings about a machine, with their remedies."""

from __future__ import annotations

import fcntl
import importlib.metadata
import pickle
import re
import shutil
import socket
import subprocess
import sys
import sysconfig
from collections import namedtuple

import pytest
from doctor_table import assert_documented

from nanorocks_ros.settings import DashboardSettings
from nanorocks_ros.tools.doctor import (
    machine_checks,
    node_processes,
    package_checks,
    ros_checks,
)
from nanorocks_ros.tools.doctor.findings import Finding, Status, worst
from nanorocks_ros.tools.doctor.ros_probe_client import loopback_finding

GB = 10**9
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
Usage = namedtuple('Usage', 'total used free')


def assert_told(fault, finding):
    assert_documented(fault, finding.status.value, finding.found, finding.remedy)


def with_free(monkeypatch, size):
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: Usage(100 * GB, 0, size))


@pytest.mark.parametrize(
    ('free', 'status'),
    [(20 * GB, Status.OK), (2 * GB, Status.WARNING), (GB // 10, Status.PROBLEM)],
)
def test_a_full_disk_is_found(monkeypatch, free, status):
    with_free(monkeypatch, free)
    assert machine_checks.disk().status is status
    if status is Status.PROBLEM:
        assert_told('the disk is full', machine_checks.disk())


def test_a_folder_that_cannot_be_written_is_a_problem(monkeypatch):
    # Also for root.
    monkeypatch.chdir('/proc')
    assert_told('the disk is read-only', machine_checks.disk())
    monkeypatch.chdir('/tmp')
    assert machine_checks.disk().remedy != 'work in another folder: cd ~'


def test_a_taken_port_is_found_and_the_advised_one_is_free(monkeypatch):
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind((DashboardSettings().host, DashboardSettings().port))
        taken.listen()
        monkeypatch.setattr(node_processes, 'running', lambda _: [])
        finding = machine_checks.live_page()
        assert_told('the port of the page is taken', finding)
        (port,) = re.findall(r'--port (\d+)', finding.remedy)
        assert f'dashboard_port:={port}' in finding.remedy
        with socket.socket() as free:
            free.bind((DashboardSettings().host, int(port)))
        # A page of this package that runs is no fault.
        page = node_processes.NodeProcess(7, 'dashboard', {})
        monkeypatch.setattr(node_processes, 'running', lambda _: [page])
        assert machine_checks.live_page().status is Status.OK
    assert machine_checks.live_page().found.endswith('is free')


def test_the_shared_memory_of_a_container_is_too_small(monkeypatch, tmp_path):
    with_free(monkeypatch, 63_000_000)  # 64 MB, as Docker gives
    finding = machine_checks.shared_memory(tmp_path)
    assert finding.status is Status.PROBLEM
    (size,) = re.findall(r'--shm-size=(\d+)g', finding.remedy)
    assert_told('shared memory is full', finding)
    with_free(monkeypatch, int(size) * GB)
    assert machine_checks.shared_memory(tmp_path).status is Status.OK


def test_what_killed_nodes_left_in_shared_memory_can_be_freed_while_others_run(tmp_path):
    for name in ('of_a_killed_node', 'of_a_node'):
        with (tmp_path / f'fastrtps_{name}').open('wb') as segment:
            segment.truncate(GB)  # without blocks on the disk
        (tmp_path / f'fastrtps_{name}_el').touch()
    with (tmp_path / 'fastrtps_of_a_node_el').open('rb') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        finding = machine_checks.shared_memory(tmp_path)
        assert finding.status is Status.WARNING
        assert_told('killed nodes left shared memory', finding)
        subprocess.run(['sh', '-c', finding.remedy], check=False)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {'fastrtps_of_a_node', 'fastrtps_of_a_node_el'}


def test_small_socket_buffers_matter_between_machines_only(monkeypatch, tmp_path):
    limit = tmp_path / 'rmem_max'
    limit.write_text('212992\n')
    monkeypatch.setenv(RANGE, 'SUBNET')
    finding = machine_checks.receive_buffer(limit)
    assert finding.status is Status.WARNING
    (size,) = re.findall(r'sysctl -w net.core.rmem_max=(\d+)', finding.remedy)
    assert_told('socket buffers are small', finding)
    limit.write_text(size)
    assert machine_checks.receive_buffer(limit).status is Status.OK
    limit.write_text('212992\n')
    assert f'export {RANGE}=LOCALHOST' in finding.remedy
    monkeypatch.setenv(RANGE, 'LOCALHOST')
    assert machine_checks.receive_buffer(limit).status is Status.OK


PICKLE_FINDING = """
import pickle
import sys

from nanorocks_ros.tools.doctor.machine_checks import compiled_kernels

sys.stdout.buffer.write(pickle.dumps(compiled_kernels()))
"""


def kernels_of_a_new_process():
    """A process decides once where it keeps kernels: here it would, for all tests that follow."""
    command = [sys.executable, '-c', PICKLE_FINDING]
    return pickle.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def test_kernels_that_cannot_be_cached_are_found(monkeypatch, tmp_path):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'new'))
    assert kernels_of_a_new_process().status is Status.OK
    (tmp_path / 'file').write_text('')
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'file'))
    finding = kernels_of_a_new_process()
    assert finding.status is Status.WARNING
    assert 'NUMBA_CACHE_DIR' in finding.remedy
    assert_told('compiled functions cannot be kept', finding)


COUNT_KERNELS = """
from nanorocks_ros.tools.compilation.parallel_compilation import listed_versions
from nanorocks_ros.tools.doctor.machine_checks import compiled_kernels

print(len(listed_versions()))
print(compiled_kernels().found)
listed_versions()[-1].compile()
print(compiled_kernels().found)
"""


def test_kernels_that_are_compiled_are_counted(monkeypatch, tmp_path):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    command = [sys.executable, '-c', COUNT_KERNELS]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    listed, before, after = said.splitlines()
    rest = f'compiled, cached in {tmp_path}; `nanorocks compile` compiles the others now'
    assert before == f'0 of {listed} {rest}'
    assert after == f'1 of {listed} {rest}'


def installed_as(monkeypatch, **versions):
    """Let libraries have other versions; None: pip does not know them."""
    real = importlib.metadata.version

    def version(name):
        if name not in versions:
            return real(name)
        if versions[name] is None:
            raise importlib.metadata.PackageNotFoundError(name)
        return versions[name]

    monkeypatch.setattr(importlib.metadata, 'version', version)


def test_an_outdated_library_is_a_warning_whose_advice_installs_what_is_tested(monkeypatch):
    installed_as(monkeypatch, mcap='0.1')
    everything = package_checks.libraries()[0]
    assert everything.status is Status.WARNING
    assert 'mcap 0.1 is not tested, >=1.2.1 is' in everything.found
    assert_told('a library is older than tested (numba, OpenCV)', everything)
    assert everything.remedy == "pip install 'mcap>=1.2.1'"
    # The oldest that this installs satisfies the check.
    installed_as(monkeypatch, mcap=everything.remedy.partition('>=')[2].rstrip("'"))
    assert package_checks.libraries()[0].status is Status.OK


def test_a_missing_library_is_a_problem(monkeypatch):
    installed_as(monkeypatch, mcap=None)
    everything = package_checks.libraries()[0]
    assert everything.status is Status.PROBLEM
    assert 'mcap is not installed; for everything' in everything.found
    assert_told('a library is missing', everything)
    assert everything.remedy == "pip install 'mcap>=1.2.1'"


def test_the_opencv_of_a_distribution_is_found_without_pip(monkeypatch):
    import cv2

    installed_as(monkeypatch, **{'opencv-python-headless': None})
    assert f'opencv-python-headless {cv2.__version__}' in package_checks.libraries()[0].found
    monkeypatch.setattr(cv2, '__version__', '4.5.1')
    everything = package_checks.libraries()[0]
    assert everything.status is Status.WARNING
    assert 'opencv-python-headless 4.5.1 is not tested' in everything.found


def test_pip_is_advised_as_the_system_allows_it(monkeypatch, tmp_path):
    assert package_checks.pip_install('av') == 'pip install av'
    (tmp_path / 'EXTERNALLY-MANAGED').touch()
    monkeypatch.setattr(sysconfig, 'get_path', lambda _: str(tmp_path))
    monkeypatch.setattr(sys, 'prefix', sys.base_prefix)
    assert package_checks.pip_install('av').startswith('pip install --break-system-packages av')


def test_a_missing_extra_is_a_warning_with_its_purpose(monkeypatch):
    installed_as(monkeypatch, pyarrow=None)
    findings = {library.name: library for library in package_checks.libraries()}
    assert findings['extra [parquet]'].status is Status.WARNING
    assert '.parquet' in findings['extra [parquet]'].found
    assert_told('an extra is missing', findings['extra [parquet]'])
    assert findings['libraries'].status is Status.OK


@pytest.mark.parametrize(
    ('value', 'status'),
    [('', Status.OK), ('42', Status.OK), ('150', Status.WARNING), ('-1', Status.PROBLEM)],
)
def test_an_invalid_domain_is_found(monkeypatch, value, status):
    monkeypatch.setenv('ROS_DOMAIN_ID', value)
    assert ros_checks.domain().status is status
    if status is Status.PROBLEM:
        assert_told('a domain that does not exist', ros_checks.domain())


@pytest.mark.parametrize(
    ('value', 'status'),
    [('LOCALHOST', Status.OK), ('localhost', Status.WARNING), ('OFF', Status.PROBLEM)],
)
def test_the_discovery_range_is_checked(monkeypatch, value, status):
    monkeypatch.delenv('ROS_LOCALHOST_ONLY', raising=False)
    monkeypatch.setenv(RANGE, value)
    assert ros_checks.discovery().status is status
    faults = {
        Status.WARNING: 'a discovery range that does not exist',
        Status.PROBLEM: 'discovery switched off',
    }
    if status in faults:
        assert_told(faults[status], ros_checks.discovery())


def test_a_missing_profile_is_a_problem(monkeypatch):
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', '/no/such/profile.xml')
    finding = ros_checks.profile()
    assert finding.status is Status.PROBLEM
    assert '/no/such/profile.xml' in finding.found
    assert_told('the Fast DDS profile is missing', finding)


@pytest.mark.parametrize(
    ('check', 'variables'),
    [
        (ros_checks.domain, {'ROS_DOMAIN_ID': '-1'}),
        (ros_checks.domain, {'ROS_DOMAIN_ID': '233'}),
        (ros_checks.discovery, {RANGE: 'localhost'}),
        (ros_checks.discovery, {RANGE: 'OFF'}),
        (ros_checks.discovery, {RANGE: 'SUBNET', 'ROS_LOCALHOST_ONLY': '1'}),
        (ros_checks.profile, {RANGE: 'SUBNET'}),
        (ros_checks.profile, {RANGE: 'LOCALHOST', 'FASTDDS_DEFAULT_PROFILES_FILE': '/none'}),
        (lambda: ros_checks.executables(('pipeline',)), {'AMENT_PREFIX_PATH': '/none'}),
        (kernels_of_a_new_process, {'NUMBA_CACHE_DIR': '/proc/none'}),
    ],
)
def test_the_advice_about_a_variable_removes_the_finding(monkeypatch, tmp_path, check, variables):
    for name in (
        'ROS_LOCALHOST_ONLY',
        'RMW_IMPLEMENTATION',
        'FASTDDS_DEFAULT_PROFILES_FILE',
        'FASTRTPS_DEFAULT_PROFILES_FILE',
    ):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    advice = check().remedy
    assert check().status is not Status.OK
    if 'colcon' in advice:
        pytest.skip('the nodes are not installed here')
    for name, value in re.findall(r'export (\w+)=([^\s;,]+)', advice):
        monkeypatch.setenv(name, value.replace('/a/folder/of/yours', str(tmp_path)))
    for names in re.findall(r'unset ([\w ]+)', advice):
        for name in names.split():
            monkeypatch.delenv(name, raising=False)
    assert check().status is Status.OK


def test_the_libraries_of_the_wheels_are_found_as_the_advice_says(monkeypatch):
    if not ros_checks.has_wheels():
        pytest.skip('there are no wheels of ROS here')
    monkeypatch.setenv('LD_LIBRARY_PATH', '/usr/lib')
    advice = ros_checks.bootstrap().remedy
    assert ros_checks.bootstrap().status is Status.PROBLEM
    # Without the variable, the next Python that loads ROS sets the path and starts again.
    check = (
        'import rclpy; from nanorocks_ros.tools.doctor.ros_checks import bootstrap; '
        'print(bootstrap().status.name)'
    )
    finished = subprocess.run(
        ['sh', '-c', f'{advice} && exec {sys.executable} -c "{check}"'],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert finished.stdout.split() == ['OK'], finished.stderr


def test_executables_are_found_as_ros2_run_finds_them(monkeypatch, tmp_path):
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/no/such/prefix:{tmp_path}')
    assert_told('ros2 run does not find the nodes', ros_checks.executables(('pipeline',)))
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
