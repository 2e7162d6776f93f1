"""The services of a player with the types of rosbag2, on machines that have them."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('rosbag2_interfaces', reason='needs rosbag2_interfaces')

from nanorocks_ros.nodes.base.communication.ros_messages import time_message
from nanorocks_ros.nodes.sources.player_services import rosbag2_services
from nanorocks_ros.recordings.bag.reader import open_bag

SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'


def test_the_services_are_those_of_ros2_bag_play(graph):
    def call(name, **fields):
        kind = getattr(rosbag2_services(), name.title().replace('_', ''))
        client = graph.node.create_client(kind, f'/nanorocks/bag_player/{name}')
        graph.until(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        graph.until(future.done)
        return future.result()

    start_ns = open_bag(SAMPLE).start_ns
    graph.start('bag_player', f'bag:={SAMPLE}', 'paused:=true')
    assert call('is_paused').paused
    assert call('play_next').success
    assert call('burst', num_messages=5).actually_burst == 5
    assert call('get_rate').rate == 1.0
    assert call('set_rate', rate=2.0).success
    assert call('get_rate').rate == 2.0
    assert not call('set_rate', rate=-1.0).success
    assert call('seek', time=time_message(start_ns + 5 * 10**9)).success
    assert not call('seek', time=time_message(10**9)).success
    call('resume')
    assert not call('is_paused').paused
    assert not call('play_next').success
    call('toggle_paused')
    assert call('is_paused').paused
    assert call('burst', num_messages=0).actually_burst > 0
    assert call('burst', num_messages=1).actually_burst == 0
