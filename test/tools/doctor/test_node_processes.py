"""Nodes of this machine that a shell does not hear."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from doctor_table import assert_documented

from nanorocks_ros.tools.doctor.findings import Status
from nanorocks_ros.tools.doctor.node_processes import NodeProcess, running, unheard

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
SLEEP = 'print("up", flush=True)\nimport time\ntime.sleep(60)\n'


@pytest.fixture
def started(tmp_path):
    """Two processes with a variable of their own: an installed node, and another program."""
    processes = {}
    for path in ('lib/nanorocks_ros/pipeline', 'lib/other/pipeline'):
        script = tmp_path / path
        script.parent.mkdir(parents=True)
        script.write_text(SLEEP)
        processes[path] = subprocess.Popen(
            [sys.executable, str(script)],
            env={**os.environ, 'ROS_DOMAIN_ID': '77'},
            stdout=subprocess.PIPE,
        )
        assert processes[path].stdout.readline() == b'up\n'
    yield processes
    for process in processes.values():
        process.kill()
        process.communicate()


def test_nodes_are_known_by_their_command_line(started):
    node, other = (process.pid for process in started.values())
    listed = {process.pid: process for process in running(('pipeline', 'simulator'))}
    assert listed[node].name == 'pipeline'
    assert listed[node].variables['ROS_DOMAIN_ID'] == '77'
    assert other not in listed
    assert node not in {process.pid for process in running(('simulator',))}


def test_a_system_without_proc_has_none(tmp_path):
    assert running(('pipeline',), tmp_path / 'proc') == []


@pytest.mark.parametrize(
    ('there', 'here', 'fault'),
    [
        ({'ROS_DOMAIN_ID': '5'}, {}, 'another domain'),
        ({}, {'ROS_DOMAIN_ID': '5'}, 'another domain'),
        ({RANGE: 'OFF'}, {RANGE: 'LOCALHOST'}, 'a node without discovery'),
        # These hear each other on one machine.
        ({RANGE: 'LOCALHOST'}, {RANGE: 'SUBNET'}, None),
        ({'ROS_DOMAIN_ID': ''}, {'ROS_DOMAIN_ID': '0'}, None),
    ],
)
def test_what_separates_is_told_with_the_command_that_joins(monkeypatch, there, here, fault):
    for name in ('ROS_DOMAIN_ID', RANGE, 'RMW_IMPLEMENTATION'):
        monkeypatch.delenv(name, raising=False)
    for name, value in here.items():
        monkeypatch.setenv(name, value)
    findings = unheard([NodeProcess(7, 'pipeline', there)])
    if fault is None:
        assert not findings
        return
    (finding,) = findings
    assert finding.status is Status.WARNING
    assert finding.name == 'pipeline (process 7)'
    assert_documented(fault, finding.status.value, finding.found, finding.remedy)
