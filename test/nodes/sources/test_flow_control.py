"""A player waits for the node that has the most frames left to acknowledge."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from std_msgs.msg import Header

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of, time_message
from nanorocks_ros.nodes.sources.flow_control import FlowControl
from nanorocks_ros.wire import topics


@pytest.fixture
def controlled(graph, own_node):
    """A flow control, and a function that acknowledges a frame as the node `listener`."""
    node, spin_until = own_node
    control = FlowControl(node)
    control.start()
    publisher = graph.node.create_publisher(Header, topics.TAKEN.name, qos_of(topics.TAKEN))
    name = graph.node.get_fully_qualified_name()

    def acknowledge(stamp_ns):
        publisher.publish(Header(stamp=time_message(stamp_ns), frame_id=name))
        spin_until(lambda: control._processed.get(name) == stamp_ns)

    spin_until(lambda: publisher.get_subscription_count() == 1)
    spin_until(lambda: control.listener_count() == 1)
    spin_until(lambda: control.is_ready() and name in control._processed)
    return control, acknowledge


def test_four_frames_may_wait_for_their_acknowledgement(controlled):
    control, acknowledge = controlled
    # Frames have their number as stamp.
    control.note_sent(1)
    acknowledge(1)
    for stamp_ns in (2, 3, 4, 5):
        assert control.is_ready()
        control.note_sent(stamp_ns)
    assert not control.is_ready()
    acknowledge(2)
    assert control.is_ready()
    control.note_sent(6)
    assert not control.is_ready()
    acknowledge(6)
    assert control.is_ready()


def test_an_acknowledgement_of_an_unknown_frame_is_ignored(controlled, graph):
    control, acknowledge = controlled
    for stamp_ns in (1, 2, 3, 4):
        control.note_sent(stamp_ns)
    acknowledge(1)
    control.note_sent(5)
    control._receive(
        Header(stamp=time_message(99), frame_id=graph.node.get_fully_qualified_name())
    )
    assert not control.is_ready()
