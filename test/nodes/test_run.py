"""Starting and ending a node: arguments that ROS does not know."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')


def test_unknown_ros_arguments_end_the_node_with_one_line(graph):
    finished = graph.wait(graph.start_program('haff_fitter', arguments=('--nonsense',)))
    assert finished.code == 2
    assert 'wrong ROS arguments' in finished.output
    assert 'Traceback' not in finished.output
