"""Typed messages beside the arrays, where nanorocks_msgs is installed."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes.base.communication.typed_messages import typed_problem
from nanorocks_ros.wire.products import ARRAY_TOPICS, TYPED_TOPICS

ROOT = Path(__file__).resolve().parents[2]
BUILT = ROOT / 'build' / 'messages'
IS_INSTALLED = importlib.util.find_spec('nanorocks_msgs') is not None


def prefixed(name, *folders):
    """A search path that begins with some folders."""
    return os.pathsep.join([*map(str, folders), *filter(None, [os.environ.get(name)])])


def test_a_typed_topic_stands_beside_every_array():
    assert {topic.name for topic in TYPED_TOPICS.values()} == {
        topic.name.replace('/', '/typed/') for topic in ARRAY_TOPICS.values()
    }


@pytest.mark.skipif(IS_INSTALLED, reason='nanorocks_msgs is installed')
def test_without_the_package_the_remedy_is_told():
    assert typed_problem().startswith('nanorocks_msgs: is not installed')
    assert 'colcon build --base-paths . msg_defs' in typed_problem()


@pytest.mark.skipif(
    not (IS_INSTALLED or BUILT.is_dir()), reason='needs nanorocks_msgs: make messages'
)
def test_records_arrive_as_typed_messages_with_exact_stamps_and_words(domain):
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
    if not IS_INSTALLED:
        packages = next(BUILT.glob('lib/python3*/site-packages'))
        environment['PYTHONPATH'] = prefixed('PYTHONPATH', ROOT, packages)
        environment['LD_LIBRARY_PATH'] = prefixed('LD_LIBRARY_PATH', BUILT / 'lib')
        environment['AMENT_PREFIX_PATH'] = prefixed('AMENT_PREFIX_PATH', BUILT)
        # Python is started once more, with the libraries of these messages.
        environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
    script = Path(__file__).with_name('typed_messages_check.py')
    check = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, timeout=120
    )
    assert check.stdout.strip().endswith('complete'), check.stderr
