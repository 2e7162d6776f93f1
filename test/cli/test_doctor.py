"""The command ``nanorocks doctor`` without ROS."""

from __future__ import annotations

import json
import subprocess
import sys

from doctor_table import assert_documented

WITHOUT_ROS = """
import importlib.util
import sys

find_spec = importlib.util.find_spec
importlib.util.find_spec = (
    lambda name, *rest: None if name == 'rclpy' else find_spec(name, *rest)
)
from nanorocks_ros.cli.main import main

sys.exit(main(sys.argv[1:]))
"""


def doctor(*arguments):
    return subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS, 'doctor', *arguments],
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_without_ros_the_other_checks_run():
    finished = doctor('--json')
    assert finished.returncode == 1, finished.stderr
    answer = json.loads(finished.stdout)
    checks = {check['name']: check for check in answer['checks']}
    assert answer['status'] == 'problem'
    assert checks['libraries']['status'] == 'ok'
    ros = checks['ROS 2']
    assert_documented('no ROS', ros['status'], ros['found'], ros['remedy'])
    assert 'frames over loopback' not in checks


def test_an_invalid_listening_time_is_a_wrong_call():
    finished = doctor('--graph', '--seconds', '-1')
    assert finished.returncode == 2
    assert '--seconds' in finished.stderr
    assert 'Traceback' not in finished.stderr
