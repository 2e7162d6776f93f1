"""The fitter as a node: arrays that it cannot use, and speeds that wait for contacts."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.nodes.haff_fitter import WaitingSpeeds
from nanorocks_ros.records import Measured, SpeedEstimate, SpeedMethod
from nanorocks_ros.wire import topics


def test_an_array_of_another_release_is_refused(graph):
    publisher = graph.node.create_publisher(
        Float32MultiArray, topics.SPEED.of(1), qos_of(topics.SPEED)
    )
    process = graph.start('haff_fitter')
    graph.until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(Float32MultiArray(data=[1.0, 2.0]))
    graph.until(lambda: '2 elements where SpeedEstimate has 15' in graph.output(process))
    assert graph.interrupt(process).code == 0


def speed(number):
    return SpeedEstimate(
        stamp_ns=number,
        tray=1,
        cycle=1,
        cycle_start_ns=0,
        mean_projected_speed=Measured(5e-3, 1e-4),
        window=0.1,
        method=SpeedMethod.TRACKING,
    )


def test_speeds_wait_as_long_as_contacts_come_with_them_and_keep_their_order():
    waiting, speeds = WaitingSpeeds(), [speed(number) for number in range(3)]
    waiting.append(speeds[0])
    assert waiting.taken() == speeds[:1]
    for later in speeds[1:]:
        waiting.contact_came()
        waiting.append(later)
        assert waiting.taken() == []
    assert waiting
    assert waiting.taken() == speeds[1:]
    assert not waiting
    assert waiting.taken() == []
