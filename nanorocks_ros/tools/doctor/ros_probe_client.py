"""Checks that need ROS, run in processes of `nanorocks_ros.nodes.probe`.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import IO, Any

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.tools.doctor.findings import Finding, Status
from nanorocks_ros.tools.doctor.ros_checks import has_wheels

_PROBE = (sys.executable, '-m', 'nanorocks_ros.nodes.probe')
_TIMEOUT_S = 60.0
_FRAMES = 5
_RMW = 'RMW_IMPLEMENTATION'
_LOCAL = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def _start_probe(*task: str, **variables: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*_PROBE, *task],
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _read_answer(process: subprocess.Popen[str]) -> dict[str, Any]:
    """The last line that a probe printed, as JSON.

    Raises
    ------
    NanorocksError
        With its last line of standard error when it failed or did not end.
    """
    try:
        output, errors = process.communicate(timeout=_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        output, errors = '', f'no answer within {_TIMEOUT_S:g} s'
    if process.returncode == 0 and output.strip():
        answer: dict[str, Any] = json.loads(output.strip().splitlines()[-1])
        return answer
    words = [line for line in errors.splitlines() if line.strip()]
    raise NanorocksError(
        'ROS 2',
        words[-1].strip() if words else f'a node ended with code {process.returncode}',
        'see the findings "ROS 2" and of the variables above',
    )


def imported() -> tuple[list[Finding], tuple[str, ...]]:
    """Whether rclpy and the messages can be imported, and the names of the executables."""
    try:
        answer = _read_answer(_start_probe('import'))
    except NanorocksError as error:
        remedy = _import_remedy() or error.do
        found = f'import failed: {error.what}'
        return [Finding(name='rclpy', status=Status.PROBLEM, found=found, remedy=remedy)], ()
    found = f'imported from {answer["where"]}, with {answer["rmw"]}'
    return [Finding(name='rclpy', found=found), _typed(answer['typed'])], tuple(
        answer['executables']
    )


def _import_remedy() -> str:
    """The remedy where a middleware is chosen that is not there; empty where it is not that."""
    chosen = os.environ.get(_RMW)
    if not chosen:
        return ''
    try:
        rmw = _read_answer(_start_probe('import', **{_RMW: ''}))['rmw']
    except NanorocksError:
        return ''
    remedy = f'unset {_RMW} (the nodes are measured with {rmw})'
    if not has_wheels():
        remedy += f'; or sudo apt install ros-jazzy-{chosen.replace("_", "-")}'
    return remedy


def _typed(problem: str) -> Finding:
    """Whether results also go out as typed messages."""
    name = 'typed messages'
    if not problem:
        return Finding(name=name, found='nanorocks_msgs')
    where, _, what = problem.partition(': ')
    found, _, remedy = what.partition('; ')
    return Finding(name=name, status=Status.WARNING, found=f'{where} {found}', remedy=remedy)


def loopback() -> Finding:
    """Whether all frames of 1080p from one process arrive in another."""
    name = 'frames over loopback'
    # A name that no graph uses, so that running nodes are not disturbed.
    topic = f'/nanorocks_doctor_{os.getpid()}/image'
    receiver = _start_probe('receive', topic, str(_FRAMES), **_LOCAL)
    sender = None
    try:
        _wait_for_line(receiver.stdout)
        sender = _start_probe('send', topic, str(_FRAMES), **_LOCAL)
        sent, received = _read_answer(sender), _read_answer(receiver)
    except NanorocksError as error:
        return Finding(name=name, status=Status.PROBLEM, found=error.what, remedy=error.do)
    finally:
        for process in (receiver, sender):
            if process is not None and process.poll() is None:
                process.kill()
                process.communicate()
    return loopback_finding(name, sent, received)


def _wait_for_line(stream: IO[str] | None) -> None:
    """Wait until the probe listens; `_read_answer` reports a probe that ended."""
    if stream is not None:
        stream.readline()


def loopback_finding(name: str, sent: dict[str, Any], received: dict[str, Any]) -> Finding:
    """The finding from the counts of the sender and the receiver."""
    size, arrived, seconds = sent['frame_bytes'], received['received'], received['seconds']
    whole = arrived == _FRAMES and received['bytes'] == _FRAMES * size
    if sent['sent'] == 0:
        found = 'two processes of this machine did not discover each other'
        remedy = (
            'allow UDP and multicast on lo (ip link set lo multicast on), check the firewall, '
            'ROS_DOMAIN_ID and the Fast DDS profile'
        )
    elif not whole:
        found = f'{arrived} of {_FRAMES} frames of {size} bytes arrived'
        remedy = 'see the findings "shared memory" and "Fast DDS profile"'
    else:
        found = f'{arrived} of {_FRAMES} frames of {size} bytes arrived in {seconds:.2f} s'
        return Finding(name=name, found=found)
    return Finding(name=name, status=Status.PROBLEM, found=found, remedy=remedy)


def graph(seconds: float) -> dict[str, Any]:
    """What runs: ``topics``, ``reports`` of nodes of themselves, and all ``executables``.

    Raises
    ------
    NanorocksError
        When the probe fails.
    """
    return _read_answer(_start_probe('graph', f'{seconds:g}'))
