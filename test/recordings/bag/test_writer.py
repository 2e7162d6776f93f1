"""BagWriter: rosbag2 folders that other tools read and that survive a crash."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    Reader,
    StoragePlugin,
    Writer,
)
from rosbags.typesys import Stores, get_typestore

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    camera_info_message,
    float_array_message,
    image_message,
    time_message,
)
from nanorocks_ros.recordings.offered_qos import OfferedQos

EPOCH = '/nanorocks/epoch'
SPEED = '/nanorocks/tray_3/speed'
CAMERA = '/nanorocks/camera/image_raw/compressed'


def test_the_reader_of_rosbags_opens_the_folder(tmp_path, record):
    path = record(tmp_path / 'run', frames=40)
    with Reader(path) as bag:
        assert {c.topic: c.msgcount for c in bag.connections} == {EPOCH: 1, CAMERA: 40, SPEED: 40}
        stamps = [stamp for _, stamp, _ in bag.messages()]
    assert len(stamps) == 81
    assert stamps == sorted(stamps)


def test_the_reader_of_rosbags_deserializes_the_messages(tmp_path, record):
    path = record(tmp_path / 'run', frames=3)
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([path], default_typestore=store) as bag:
        chosen = [c for c in bag.connections if c.topic == SPEED]
        messages = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages(chosen)]
    assert [message.data[0] for message in messages] == [0.0, 0.5, 1.0]
    assert np.isnan(messages[0].data[1])
    dimension = messages[0].layout.dim[0]
    assert (dimension.label, dimension.size, dimension.stride) == ('time,cycle', 2, 2)


def copied_by_rosbags(ours, path):
    """A copy of a recording by the writer of rosbags; the text of its metadata."""
    text = (ours / 'metadata.yaml').read_text('utf-8')
    custom = yaml.safe_load(text)['rosbag2_bagfile_information']['custom_data']
    theirs = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    theirs.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    for key, value in custom.items():
        theirs.set_custom_data(key, value)
    with Reader(ours) as bag, theirs:
        copies = {
            connection.id: theirs.add_connection(
                connection.topic,
                connection.msgtype,
                msgdef=connection.msgdef.data,
                rihs01=connection.digest,
                offered_qos_profiles=connection.ext.offered_qos_profiles,
            )
            for connection in sorted(bag.connections, key=lambda each: each.id)
        }
        for connection, stamp, raw in bag.messages():
            theirs.write(copies[connection.id], stamp, raw)
    return (path / 'metadata.yaml').read_text('utf-8')


def test_the_metadata_are_those_that_the_writer_of_rosbags_writes(tmp_path, record):
    ours = record(tmp_path / 'first' / 'run', frames=3)
    wanted = yaml.safe_load(copied_by_rosbags(ours, tmp_path / 'second' / 'run'))
    whole = yaml.safe_load((ours / 'metadata.yaml').read_text('utf-8'))
    assert whole == wanted
    # The file itself holds them, too.
    with next(ours.glob('*.mcap')).open('rb') as stream:
        (record,) = list(make_reader(stream).iter_metadata())
    inner = yaml.safe_load(record.metadata['serialized_metadata'])
    assert {'rosbag2_bagfile_information': inner} == whole


def test_metadata_holds_the_offered_qos(tmp_path, record):
    path = record(tmp_path / 'run', frames=1)
    with Reader(path) as bag:
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in bag.connections}
    assert offered[EPOCH].durability is QosDurability.TRANSIENT_LOCAL
    assert offered[EPOCH].depth == 1
    assert offered[SPEED].reliability is QosReliability.BEST_EFFORT
    assert offered[CAMERA].reliability is QosReliability.RELIABLE
    assert offered[CAMERA].durability is QosDurability.VOLATILE
    document = yaml.safe_load((path / 'metadata.yaml').read_text())
    information = document['rosbag2_bagfile_information']
    assert information['version'] == 9
    profile = information['topics_with_message_count'][0]['topic_metadata']
    assert profile['offered_qos_profiles'][0]['durability'] == 'transient_local'


def test_the_mcap_file_contains_the_offered_qos_and_the_provenance(tmp_path, record):
    path = record(tmp_path / 'run', frames=1)
    with (path / 'run.mcap').open('rb') as stream:
        reader = make_reader(stream)
        channels = reader.get_summary().channels.values()
        assert all('depth' in c.metadata['offered_qos_profiles'] for c in channels)
        (metadata,) = reader.iter_metadata()
    assert "tray: '3'" in metadata.metadata['serialized_metadata']


def test_provenance_is_read_back(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run', frames=1))
    assert bag.metadata == {'nanorocks_ros': '0.0', 'tray': '3'}


def test_chunks_are_compressed_and_indexed_for_seeking(tmp_path, topics):
    with BagWriter(tmp_path / 'run', topics, metadata={}) as bag:
        for second in range(5):
            message = float_array_message(['zeros'] * 1000, np.zeros(1000))
            bag.write(SPEED, second * 1_000_000_000, message)
    with (tmp_path / 'run' / 'run.mcap').open('rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert len(chunks) >= 2
    assert all(chunk.compression == 'zstd' for chunk in chunks)
    assert all(chunk.compressed_size < chunk.uncompressed_size / 5 for chunk in chunks)


def test_the_same_messages_give_the_same_bytes(tmp_path, record):
    first = record(tmp_path / 'a' / 'run') / 'run.mcap'
    second = record(tmp_path / 'b' / 'run') / 'run.mcap'
    assert first.read_bytes() == second.read_bytes()


def test_an_existing_path_is_not_overwritten(tmp_path, topics):
    (tmp_path / 'run').mkdir()
    with (
        pytest.raises(RecordingError, match=r'run: exists already.*; pass another path$'),
        BagWriter(tmp_path / 'run', topics, metadata={}),
    ):
        pass


def test_a_path_below_a_file_is_refused(tmp_path, topics):
    (tmp_path / 'file').touch()
    with (
        pytest.raises(RecordingError, match=r'cannot be written \(Not a directory\)') as caught,
        BagWriter(tmp_path / 'file' / 'run', topics, metadata={}),
    ):
        pass
    assert isinstance(caught.value.__cause__, OSError)


def test_an_undeclared_topic_is_refused(tmp_path, topics):
    with (
        pytest.raises(RecordingError, match=r"topic '/other' was not declared"),
        BagWriter(tmp_path / 'run', topics, metadata={}) as bag,
    ):
        bag.write('/other', 0, time_message(0))


def test_a_message_of_another_type_is_refused(tmp_path, topics):
    with (
        pytest.raises(RecordingError, match=r'Time is not a valid std_msgs/msg/Float32MultiArray'),
        BagWriter(tmp_path / 'run', topics, metadata={}) as bag,
    ):
        bag.write(SPEED, 0, time_message(0))


@pytest.mark.parametrize('definition', ['', 'nonsense (('])
def test_a_type_without_usable_definition_is_refused(tmp_path, definition):
    kind = OfferedTopic(msgtype='my_msgs/msg/Odd', qos=OfferedQos(), definition=definition)
    with (
        pytest.raises(RecordingError, match=r"/odd: type 'my_msgs/msg/Odd' is not part of ROS 2"),
        BagWriter(tmp_path / 'run', {'/odd': kind}, metadata={}) as bag,
    ):
        bag.write_raw('/odd', 0, b'')


def test_a_full_disk_is_reported_and_written_messages_are_readable(tmp_path):
    script = tmp_path / 'recorder.py'
    script.write_text(
        'import resource, sys\n'
        'import numpy as np\n'
        'from nanorocks_ros.errors import RecordingError\n'
        'from nanorocks_ros.recordings.messages.message_builders import compressed_image_message\n'
        'from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic\n'
        'from nanorocks_ros.recordings.bag.writer import BagWriter\n'
        'from nanorocks_ros.recordings.offered_qos import OfferedQos\n'
        'resource.setrlimit(resource.RLIMIT_FSIZE, (2_500_000, 2_500_000))\n'
        "kind = OfferedTopic(msgtype='sensor_msgs/msg/CompressedImage', qos=OfferedQos())\n"
        'noise = np.random.default_rng(0)\n'
        'try:\n'
        "    with BagWriter(sys.argv[1], {'/t': kind}, metadata={}) as bag:\n"
        '        for n in range(100):\n'
        "            m = compressed_image_message(n, 'camera', 'jpeg', noise.bytes(100_000))\n"
        "            bag.write('/t', n, m)\n"
        'except RecordingError as error:\n'
        '    sys.exit(str(error))\n'
    )
    environment = {**os.environ, 'PYTHONPATH': str(Path(__file__).parents[3])}
    run = [sys.executable, str(script), str(tmp_path / 'run')]
    done = subprocess.run(run, env=environment, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.endswith(
        'cannot be written (File too large); pass another path, or make room there'
    )
    bag = open_bag(tmp_path / 'run')
    assert not bag.complete
    assert bag.topics['/t'].count >= 10


def test_a_negative_stamp_is_refused(tmp_path, topics):
    with (
        pytest.raises(RecordingError, match=r'stamp -1 ns is before 1970'),
        BagWriter(tmp_path / 'run', topics, metadata={}) as bag,
    ):
        bag.write(EPOCH, -1, time_message(0))


def test_a_stamp_after_2038_is_refused(tmp_path, topics):
    last_ns = (2**31 - 1) * 1_000_000_000
    with BagWriter(tmp_path / 'run', topics, metadata={}) as bag:
        bag.write(EPOCH, last_ns, time_message(last_ns))
        with pytest.raises(RecordingError, match=r'is after 2038-01-19, .*; .*--rate'):
            bag.write(EPOCH, last_ns + 1_000_000_000, time_message(last_ns + 1_000_000_000))
    assert [message.log_time_ns for message in open_bag(tmp_path / 'run').messages()] == [last_ns]


def test_a_number_that_does_not_fit_its_field_is_refused(tmp_path, topics):
    message = time_message(7)
    message.nanosec = -1
    with (
        pytest.raises(RecordingError, match=r'Time is not a valid builtin_interfaces/msg/Time \('),
        BagWriter(tmp_path / 'run', topics, metadata={}) as bag,
    ):
        bag.write(EPOCH, 7, message)


def test_after_an_exception_written_messages_are_readable(tmp_path, topics):
    def record_until_it_fails():
        with BagWriter(tmp_path / 'run', topics, metadata={}) as writer:
            writer.write(EPOCH, 7, time_message(7))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        record_until_it_fails()
    bag = open_bag(tmp_path / 'run')
    assert bag.complete
    assert [m.log_time_ns for m in bag.messages()] == [7]


def test_raw_messages_are_read_back_byte_for_byte(tmp_path, topics, record):
    source = list(open_bag(record(tmp_path / 'run', frames=5)).messages())
    with BagWriter(tmp_path / 'copy', topics, metadata={}) as bag:
        for message in source:
            bag.write_raw(message.topic, message.log_time_ns, message.cdr)
    assert list(open_bag(tmp_path / 'copy').messages()) == source


def test_types_that_are_not_part_of_jazzy_are_written_with_their_definition(tmp_path):
    kind = OfferedTopic(
        msgtype='my_msgs/msg/Grain', qos=OfferedQos(), definition='float64 radius\nstring name\n'
    )
    with BagWriter(tmp_path / 'run', {'/grain': kind}, metadata={}) as bag:
        cdr = b'\x00\x01\x00\x00' + np.float64(0.5).tobytes() + b'\x03\x00\x00\x00hi\x00'
        bag.write_raw('/grain', 1, cdr)
    bag = open_bag(tmp_path / 'run')
    (message,) = bag.messages()
    grain = bag.deserialize(message)
    assert (grain.radius, grain.name) == (0.5, 'hi')


def test_images_and_camera_infos_are_read_back(tmp_path):
    image = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    field = np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)
    matrix = np.array([[900.0, 0, 960], [0, 900, 540], [0, 0, 1]])
    info = camera_info_message(
        5, 'camera', (1920, 1080), matrix, ('equidistant', (0.1, 0.0, 0.0, 0.0))
    )
    table = {
        '/image': OfferedTopic(msgtype='sensor_msgs/msg/Image', qos=OfferedQos()),
        '/info': OfferedTopic(msgtype='sensor_msgs/msg/CameraInfo', qos=OfferedQos()),
    }
    with BagWriter(tmp_path / 'run', table, metadata={}) as writer:
        writer.write('/image', 1, image_message(1, 'camera', 'bgr8', image))
        writer.write('/image', 2, image_message(2, 'camera', '32FC1', field))
        writer.write('/info', 3, info)
    bag = open_bag(tmp_path / 'run')
    colour, floats, back = (bag.deserialize(message) for message in bag.messages())
    assert np.array_equal(colour.data.reshape(4, 5, 3), image)
    assert colour.step == 15
    assert np.array_equal(floats.data.view('<f4').reshape(3, 4), field)
    assert floats.step == 16
    assert back.distortion_model == 'equidistant'
    assert np.array_equal(back.k.reshape(3, 3), matrix)
    assert back.p[2] == 960.0


def test_a_killed_recorder_loses_at_most_the_last_second(tmp_path):
    script = tmp_path / 'recorder.py'
    script.write_text(
        'import os, sys, signal\n'
        'from nanorocks_ros.recordings.messages.message_builders import time_message\n'
        'from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic\n'
        'from nanorocks_ros.recordings.bag.writer import BagWriter\n'
        'from nanorocks_ros.recordings.offered_qos import OfferedQos\n'
        "kind = OfferedTopic(msgtype='builtin_interfaces/msg/Time', qos=OfferedQos())\n"
        "with BagWriter(sys.argv[1], {'/t': kind}, metadata={}) as bag:\n"
        '    for number in range(100):\n'
        "        bag.write('/t', number * 100_000_000, time_message(number))\n"
        '    os.kill(os.getpid(), signal.SIGKILL)\n'
    )
    environment = {**os.environ, 'PYTHONPATH': str(Path(__file__).parents[3])}
    run = [sys.executable, str(script), str(tmp_path / 'run')]
    assert subprocess.run(run, env=environment, check=False).returncode == -9
    bag = open_bag(tmp_path / 'run')
    assert not bag.complete
    assert any('no metadata.yaml' in notice for notice in bag.notices)
    assert any('cut short' in notice for notice in bag.notices)
    assert bag.topics['/t'].count >= 89
    assert len(list(bag.messages())) == bag.topics['/t'].count
