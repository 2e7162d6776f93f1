"""A node accepts the old name of a renamed setting as a parameter, with a warning."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

import rclpy

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.settings import PipelineSettings


@pytest.fixture
def declared(domain):
    """Return a function: the settings that a node declares, for parameters like ``a.b:=1.0``."""
    nodes = []

    def declare(*rules):
        arguments = [word for rule in rules for word in ('-p', rule)]
        rclpy.init(args=['--ros-args', *arguments], domain_id=domain)
        nodes.append(NanorocksNode('declaring'))
        settings = nodes[0].parameters.declare(PipelineSettings())
        nodes[0].parameters.refuse_unknown()
        return settings

    yield declare
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


def test_the_old_name_of_a_setting_sets_it_with_a_warning(declared, capfd):
    assert declared('tracking.fastest:=0.1').tracking.max_speed == 0.1
    assert "'tracking.fastest' is now called 'tracking.max_speed'" in capfd.readouterr().err


def test_the_old_and_the_new_name_together_are_refused(declared):
    with pytest.raises(ConfigurationError, match='are the same setting'):
        declared('tracking.fastest:=0.1', 'tracking.max_speed:=0.1')
