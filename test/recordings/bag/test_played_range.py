"""Time range for playback, latched messages at its start, and metadata for ros2 bag."""

from __future__ import annotations

import pytest
import yaml
from rosbags.rosbag2 import Reader

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.played_range import latched_messages, played_range
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import float_array_message, time_message
from nanorocks_ros.recordings.offered_qos import OfferedQos

NS = 10**9
LATCHED = OfferedQos(transient_local=True, depth=1)
TOPICS = {
    '/epoch': OfferedTopic(msgtype='builtin_interfaces/msg/Time', qos=LATCHED),
    '/cor': OfferedTopic(msgtype='std_msgs/msg/Float32MultiArray', qos=LATCHED),
    '/late': OfferedTopic(msgtype='builtin_interfaces/msg/Time', qos=OfferedQos(reliable=False)),
}


@pytest.fixture
def bag(tmp_path):
    """300 s with an epoch at the start, a COR every half second, and a message at the end."""
    with BagWriter(tmp_path / 'bag', TOPICS, metadata={'made': 'here'}) as writer:
        writer.write('/epoch', 100 * NS, time_message(100 * NS))
        for k in range(600):
            message = float_array_message(['cor'], [float(k)])
            writer.write('/cor', 100 * NS + k * NS // 2, message)
        writer.write('/late', 400 * NS, time_message(0))
    return open_bag(tmp_path / 'bag')


def test_the_played_range_ends_before_its_duration_is_over(bag):
    assert played_range(bag, 0.0, 0.0) == (100 * NS, 400 * NS)
    assert played_range(bag, 10.0, 5.0) == (110 * NS, 115 * NS - 1)
    assert played_range(bag, 299.0, 500.0) == (399 * NS, 400 * NS)


def test_a_start_beyond_the_end_is_refused(bag):
    with pytest.raises(ConfigurationError, match=r'start: 301 s, but .* has 300\.000 s'):
        played_range(bag, 301.0, 0.0)


@pytest.mark.parametrize(('seconds', 'value'), [(0.6, 1.0), (150.0, 299.0), (300.0, 599.0)])
def test_latched_topics_have_their_last_message_before_the_start(bag, seconds, value):
    messages = latched_messages(bag, list(TOPICS), 100 * NS + round(seconds * NS))
    assert [message.topic for message in messages] == ['/epoch', '/cor']
    assert bag.deserialize(messages[1]).data[0] == value


def test_at_the_start_no_message_is_latched(bag):
    assert latched_messages(bag, list(TOPICS), bag.start_ns) == []


def test_the_metadata_has_the_format_of_ros2_bag_jazzy(bag):
    """Fields and types as `rosbag2_storage/yaml.hpp` decodes them for version 9 of the format."""
    text = (bag.path / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    assert (information['version'], information['storage_identifier']) == (9, 'mcap')
    # Chunks are compressed by the storage; rosbag2 must not try to decompress anything itself.
    assert (information['compression_format'], information['compression_mode']) == ('', '')
    assert isinstance(information['duration']['nanoseconds'], int)
    assert isinstance(information['starting_time']['nanoseconds_since_epoch'], int)
    assert information['relative_file_paths'] == [file['path'] for file in information['files']]
    assert set(information['files'][0]) == {'path', 'starting_time', 'duration', 'message_count'}
    assert information['custom_data'] == {'made': 'here'}
    assert isinstance(information['ros_distro'], str)
    for entry in information['topics_with_message_count']:
        topic = entry['topic_metadata']
        assert topic['serialization_format'] == 'cdr'
        assert topic['type_description_hash'].startswith('RIHS01_')
        (profile,) = topic['offered_qos_profiles']
        assert profile['history'] == 'keep_last'
        assert profile['reliability'] in ('reliable', 'best_effort')
        assert profile['durability'] in ('transient_local', 'volatile')
        assert profile['liveliness'] == 'automatic'
        assert set(profile['deadline']) == {'sec', 'nsec'}
    with Reader(bag.path) as reader:
        assert reader.message_count == information['message_count'] == 602
        assert {connection.topic for connection in reader.connections} == set(TOPICS)
