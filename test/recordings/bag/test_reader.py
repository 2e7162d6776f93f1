"""BagReader: intact, truncated and damaged recordings, and errors in one line."""

from __future__ import annotations

import itertools
import os
import shlex
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.reader import BagMessage, open_bag
from nanorocks_ros.recordings.mcap import mcap_file
from nanorocks_ros.recordings.mcap.mcap_blocks import load
from nanorocks_ros.recordings.messages.message_builders import time_message
from nanorocks_ros.recordings.offered_qos import OfferedQos, recorded_qos
from nanorocks_ros.recordings.storage import LAST_NS

EPOCH = '/nanorocks/epoch'
SPEED = '/nanorocks/tray_3/speed'
CAMERA = '/nanorocks/camera/image_raw/compressed'
START_NS = 1_000_000_000_000_000_000
TIME_TYPE = 'builtin_interfaces/msg/Time'


def one_line(error: RecordingError) -> str:
    text = str(error)
    assert '\n' not in text
    assert '; ' in text
    return text


def test_an_intact_bag_has_all_topics_and_no_notice(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run', frames=31))
    assert bag.complete
    assert bag.notices == ()
    assert bag.messages_lost == 0
    assert {info.name: info.count for info in bag.topics.values()} == {
        EPOCH: 1, CAMERA: 31, SPEED: 31,
    }  # fmt: skip
    assert bag.topics[CAMERA].type == 'sensor_msgs/msg/CompressedImage'
    assert bag.start_ns == START_NS
    assert bag.end_ns == START_NS + 30 * 33_333_333


def test_the_storage_file_alone_is_read_like_the_folder(tmp_path, record):
    path = record(tmp_path / 'run')
    from_folder = list(open_bag(path).messages())
    assert list(open_bag(str(path / 'run.mcap')).messages()) == from_folder
    assert len(from_folder) == 81


def test_only_the_requested_topics_are_read(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run'))
    assert {m.topic for m in bag.messages([SPEED, EPOCH])} == {SPEED, EPOCH}
    assert list(bag.messages(['/not/there'])) == []
    assert list(bag.messages([])) == []


def test_a_bag_can_be_read_by_two_iterators_at_the_same_time(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run'))
    pairs = list(zip(bag.messages(), bag.messages(), strict=True))
    assert all(message == other for message, other in pairs)
    assert len(pairs) == 81


@pytest.mark.parametrize('compression', list(CompressionType))
def test_messages_are_sorted_by_time(tmp_path, compression):
    stamps = np.random.default_rng(3).permutation(300)
    path = write_times(tmp_path / 'x.mcap', stamps, compression=compression, chunk_size=400)
    bag = open_bag(path)
    assert [m.log_time_ns for m in bag.messages()] == sorted(stamps)
    assert bag.complete


@pytest.mark.parametrize('options', [
    {'index_types': IndexType.NONE},
    {'use_statistics': False},
    {'use_summary_offsets': False},
    {'repeat_channels': False, 'repeat_schemas': False},
    {'use_chunking': False},
    {'use_chunking': False, 'use_statistics': False},
    {'enable_crcs': False},
])  # fmt: skip
def test_files_without_parts_of_the_index_are_complete(tmp_path, options):
    bag = open_bag(write_times(tmp_path / 'x.mcap', range(50), **options))
    assert [m.log_time_ns for m in bag.messages()] == list(range(50))
    assert bag.topics['/time'].count == 50
    assert bag.complete
    assert bag.notices == ()


def write_times(path, stamps, **options):
    store = get_typestore(Stores.ROS2_JAZZY)
    text, _ = store.generate_msgdef(TIME_TYPE, ros_version=2)
    writer = McapWriter(str(path), **options)
    writer.start()
    schema = writer.register_schema(TIME_TYPE, 'ros2msg', text.encode())
    channel = writer.register_channel('/time', 'cdr', schema)
    for stamp in stamps:
        cdr = bytes(store.serialize_cdr(time_message(int(stamp)), TIME_TYPE))
        writer.add_message(channel, int(stamp), cdr, int(stamp))
    writer.finish()
    return path


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('version', [8, 9])
def test_the_offered_quality_of_service_is_read_back(tmp_path, plugin, version):
    store = get_typestore(Stores.ROS2_JAZZY)
    offered = OfferedQos(reliable=False, transient_local=True, depth=7)
    with Writer(tmp_path / 'run', version=version, storage_plugin=plugin) as writer:
        for name, profiles in (('/a', [offered.profile()]), ('/b', [])):
            connection = writer.add_connection(
                name, TIME_TYPE, typestore=store, offered_qos_profiles=profiles
            )
            writer.write(connection, 1, store.serialize_cdr(time_message(1), TIME_TYPE))
    bag = open_bag(tmp_path / 'run')
    assert bag.topics['/a'].qos == offered
    assert bag.topics['/b'].qos is None


@pytest.mark.parametrize('text', ['', '[', '3', '- 1', '- depth: x', '- {depth: 1}', '[' * 500])
def test_an_invalid_quality_of_service_is_none(text):
    assert recorded_qos(text) is None


# --- a time range ----------------------------------------------------------------------------


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize(('start', 'end', 'expected'), [
    (None, None, [1, 2, 3]),
    (2, None, [2, 3]),
    (None, 2, [1, 2]),
    (2, 2, [2]),
    (3, 1, []),
    (4, None, []),
    (-(2**70), 2**70, [1, 2, 3]),
])  # fmt: skip
def test_a_time_range_includes_both_ends(tmp_path, plugin, start, end, expected):
    bag = open_bag(write_with_rosbags(tmp_path / 'run', plugin))
    messages = bag.messages(['/time'], start_ns=start, end_ns=end)
    assert [m.log_time_ns for m in messages] == expected


@pytest.mark.parametrize('cut', [None, -30])
def test_only_the_chunks_of_a_time_range_are_read(tmp_path, record, monkeypatch, cut):
    path = record(tmp_path / 'run', frames=400)
    file = path / 'run.mcap'
    file.write_bytes(file.read_bytes()[:cut])
    bag = open_bag(path)
    everything = list(bag.messages())
    start, end = everything[300].log_time_ns, everything[420].log_time_ns
    loaded = 0

    def counting(stream, block, catalogue):
        nonlocal loaded
        messages = load(stream, block, catalogue)
        loaded += len(messages)
        return messages

    monkeypatch.setattr(mcap_file, 'load', counting)
    selected = list(bag.messages(start_ns=start, end_ns=end))
    assert selected == [m for m in everything if start <= m.log_time_ns <= end]
    assert len(selected) <= loaded < len(everything) / 2


def test_seeking_in_a_split_recording_skips_whole_files(tmp_path, record):
    folder = tmp_path / 'split'
    folder.mkdir()
    for number in range(3):
        part = record(tmp_path / f'part_{number}', frames=4, first=4 * number)
        (part / f'part_{number}.mcap').rename(folder / f'split_{number}.mcap')
    bag = open_bag(folder)
    everything = list(bag.messages([SPEED]))
    start, end = everything[6].log_time_ns, everything[8].log_time_ns
    assert list(bag.messages([SPEED], start, end)) == everything[6:9]


# --- cut short ------------------------------------------------------------------------------


def test_a_bag_cut_anywhere_is_read_up_to_the_cut(tmp_path, record):
    path = record(tmp_path / 'run', frames=40, size=3000) / 'run.mcap'
    whole = path.read_bytes()
    everything = list(open_bag(path).messages())
    cuts = np.random.default_rng(1).integers(1, len(whole), 150).tolist()
    cuts += [*range(1, 80), *range(len(whole) - 60, len(whole))]
    before = 0
    for cut in sorted(cuts):
        short = tmp_path / 'short.mcap'
        short.write_bytes(whole[:cut])
        bag = open_bag(short)
        messages = list(bag.messages())
        assert messages == everything[: len(messages)], cut
        assert sum(info.count for info in bag.topics.values()) == len(messages)
        assert len(messages) >= before
        assert not bag.complete
        (notice,) = bag.notices
        assert f'cut short; {len(messages)} messages over ' in notice
        assert 'bytes at the end hold no complete record' in notice
        before = len(messages)
    assert before == len(everything)


def test_complete_messages_of_a_truncated_chunk_are_read(tmp_path, record):
    path = record(tmp_path / 'run', frames=25, size=30_000) / 'run.mcap'
    with path.open('rb') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[0]
    short = tmp_path / 'short.mcap'
    short.write_bytes(path.read_bytes()[: chunk.chunk_start_offset + chunk.chunk_length // 2])
    assert 8 <= open_bag(short).topics[CAMERA].count <= 13


@pytest.mark.parametrize('options', [
    {'use_chunking': False},
    {'compression': CompressionType.LZ4, 'chunk_size': 500},
    {'compression': CompressionType.NONE, 'chunk_size': 500},
])  # fmt: skip
def test_other_storage_options_are_read_up_to_the_cut(tmp_path, options):
    whole = write_times(tmp_path / 'x.mcap', range(100), **options).read_bytes()
    counts = []
    for cut in range(1, len(whole), 37):
        short = tmp_path / 'short.mcap'
        short.write_bytes(whole[:cut])
        bag = open_bag(short)
        stamps = [m.log_time_ns for m in bag.messages()]
        assert stamps == list(range(len(stamps)))
        assert not bag.complete
        counts.append(len(stamps))
    assert counts == sorted(counts)
    assert counts[-1] == 100


def test_zeros_behind_a_crash_are_not_mistaken_for_records(tmp_path, record):
    path = record(tmp_path / 'run', frames=40) / 'run.mcap'
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + bytes(5000))
    bag = open_bag(path)
    assert not bag.complete
    assert 20 <= len(list(bag.messages())) < 81


def test_a_folder_without_metadata_is_read_with_a_notice(tmp_path, record):
    path = record(tmp_path / 'run')
    (path / 'metadata.yaml').unlink()
    bag = open_bag(path)
    assert len(list(bag.messages())) == 81
    assert bag.notices == (
        f'{path}: has no metadata.yaml, as after a crash; the bag is read without it',
    )


@pytest.mark.parametrize('text', ['', '[', 'a: b', '- 1', 'rosbag2_bagfile_information: 3', '\0'])
def test_invalid_metadata_is_ignored_with_a_notice(tmp_path, record, text):
    path = record(tmp_path / 'run', frames=2)
    (path / 'metadata.yaml').write_text(text)
    bag = open_bag(path)
    assert len(list(bag.messages())) == 5
    assert 'cannot be parsed' in bag.notices[0]


# --- damaged --------------------------------------------------------------------------------


def test_a_damaged_chunk_is_skipped_and_counted(tmp_path, record):
    path = record(tmp_path / 'run', frames=150) / 'run.mcap'
    everything = list(open_bag(path).messages())
    with path.open('rb') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[1]
    content = bytearray(path.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0x10
    path.write_bytes(content)
    bag = open_bag(path)
    for _ in range(2):
        messages = list(bag.messages())
        lost = [m for m in everything if m not in messages]
        assert [m for m in everything if m in messages] == messages
        assert len(lost) == bag.messages_lost > 0
        assert not bag.complete
        (notice,) = bag.notices
        assert f'1 damaged block was skipped, at least {len(lost)} messages are lost' in notice


def test_a_flipped_bit_anywhere_costs_messages_but_never_more(tmp_path, record):
    path = record(tmp_path / 'run', frames=20, size=500) / 'run.mcap'
    whole = path.read_bytes()
    everything = dict.fromkeys(open_bag(path).messages())
    generator = np.random.default_rng(2)
    offsets = [
        *generator.integers(8, len(whole), 200).tolist(),
        *range(len(whole) - 700, len(whole)),
    ]
    for offset in offsets:
        content = bytearray(whole)
        content[offset] ^= 1 << int(generator.integers(8))
        path.write_bytes(content)
        bag = open_bag(path)
        messages = list(bag.messages())
        assert len(messages) <= len(everything)
        for message in messages:
            if message in everything:
                continue
            # A name in the index may be damaged, but never the content of a message.
            assert message.cdr in {m.cdr for m in everything}


def test_a_damaged_chunk_of_a_file_cut_short_is_counted_by_its_index(tmp_path, record):
    path = record(tmp_path / 'run', frames=150) / 'run.mcap'
    with path.open('rb') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[1]
    content = bytearray(path.read_bytes()[:-30])
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0x10
    path.write_bytes(content)
    bag = open_bag(path)
    messages = list(bag.messages())
    assert bag.messages_lost > 0
    assert len(messages) + bag.messages_lost == 301


# --- several files, SQLite, compression -----------------------------------------------------


def test_a_recording_split_into_files_is_one(tmp_path, record):
    folder = tmp_path / 'split'
    folder.mkdir()
    # Names whose alphabetical order is not that of time.
    for number, first in ((9, 0), (10, 40), (11, 80)):
        part = record(tmp_path / f'part_{number}', frames=40, first=first)
        (part / f'part_{number}.mcap').rename(folder / f'split_{number}.mcap')
    bag = open_bag(folder)
    stamps = [m.log_time_ns for m in bag.messages([SPEED])]
    assert len(stamps) == bag.topics[SPEED].count == 120
    assert stamps == sorted(stamps)


def test_an_empty_last_file_of_a_split_recording_costs_only_itself(tmp_path, record):
    folder = record(tmp_path / 'run', frames=4)
    (folder / 'metadata.yaml').unlink()
    (folder / 'run_1.mcap').touch()
    bag = open_bag(folder)
    assert len(list(bag.messages())) == 9
    assert not bag.complete
    assert any('run_1.mcap: is empty (0 bytes)' in notice for notice in bag.notices)


def test_a_missing_file_of_a_split_recording_is_reported(tmp_path, record):
    folder = record(tmp_path / 'run', frames=4)
    text = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(text.replace('  - run.mcap', '  - run.mcap\n  - b.mcap'))
    bag = open_bag(folder)
    assert bag.notices == (f'{folder / "b.mcap"}: is missing',)
    assert not bag.complete
    assert len(list(bag.messages())) == 9


def write_with_rosbags(path, plugin, mode=CompressionMode.NONE):
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Writer(path, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection('/time', TIME_TYPE, typestore=store)
        for stamp in (3, 1, 2):
            writer.write(connection, stamp, store.serialize_cdr(time_message(stamp), TIME_TYPE))
    return path


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('mode', [CompressionMode.NONE, CompressionMode.MESSAGE])
def test_sqlite_and_compressed_messages_are_read(tmp_path, plugin, mode):
    bag = open_bag(write_with_rosbags(tmp_path / 'run', plugin, mode))
    messages = list(bag.messages())
    assert [m.log_time_ns for m in messages] == [1, 2, 3]
    assert [bag.deserialize(m).nanosec for m in messages] == [1, 2, 3]
    assert bag.complete
    assert (bag.start_ns, bag.end_ns) == (1, 3)
    assert bag.topics['/time'].count == 3


def test_a_folder_with_sqlite_storage_needs_no_metadata(tmp_path):
    written = write_with_rosbags(tmp_path / 'run', StoragePlugin.SQLITE3)
    folder = written.rename(tmp_path / 'run #1? %20')
    (folder / 'metadata.yaml').unlink()
    assert len(list(open_bag(folder).messages(['/time']))) == 3
    assert len(list(open_bag(next(folder.glob('*.db3'))).messages())) == 3


def test_a_damaged_sqlite_file_is_no_traceback(tmp_path):
    folder = write_with_rosbags(tmp_path / 'run', StoragePlugin.SQLITE3)
    file = next(folder.glob('*.db3'))
    whole = file.read_bytes()
    refusals = []
    for cut in range(20, len(whole), 1000):
        file.write_bytes(whole[:cut])
        try:
            list(open_bag(folder).messages())
        except RecordingError as error:
            refusals.append(one_line(error))
    assert refusals
    assert all('cannot be read as a recording' in text for text in refusals)


def test_file_compression_is_refused_with_a_remedy(tmp_path):
    folder = write_with_rosbags(tmp_path / 'run', StoragePlugin.SQLITE3, CompressionMode.FILE)
    with pytest.raises(RecordingError, match=r'compressed as a whole.*; unpack them with `zstd'):
        open_bag(folder)


# --- inputs that are no recordings ----------------------------------------------------------


def test_a_missing_path_is_reported(tmp_path):
    with pytest.raises(RecordingError, match=r'nowhere: does not exist; pass a rosbag2 folder'):
        open_bag(tmp_path / 'nowhere')


def test_another_file_is_no_bag(tmp_path):
    (tmp_path / 'notes.txt').write_text('not a bag at all')
    with pytest.raises(RecordingError, match=r'notes\.txt: is not a bag; pass a rosbag2 folder'):
        open_bag(tmp_path / 'notes.txt')


def test_a_folder_without_storage_is_no_bag(tmp_path):
    (tmp_path / 'metadata.yaml').write_text('')
    with pytest.raises(RecordingError, match=r'is a folder without any \.mcap or \.db3 file; '):
        open_bag(tmp_path)


def test_wrong_magic_bytes_are_reported(tmp_path):
    (tmp_path / 'x.mcap').write_bytes(b'\x89PNG\r\n\x1a\n' + bytes(100))
    with pytest.raises(
        RecordingError, match=r"x\.mcap: is not an MCAP file \(begins with b'\\x89P"
    ):
        open_bag(tmp_path / 'x.mcap')


def test_an_empty_file_is_reported(tmp_path):
    (tmp_path / 'x.mcap').touch()
    with pytest.raises(RecordingError, match=r'x\.mcap: is empty \(0 bytes\); record it again'):
        open_bag(tmp_path / 'x.mcap')


def test_a_ros_1_bag_is_named_with_its_converter(tmp_path):
    (tmp_path / 'old.bag').write_bytes(b'#ROSBAG V2.0\n' + bytes(100))
    with pytest.raises(RecordingError, match=r'old\.bag: is a ROS 1 bag; .*rosbags-convert --src'):
        open_bag(tmp_path / 'old.bag')


@pytest.mark.parametrize(('name', 'target'), [
    ('old.bag', 'old'), ('my run 1.bag', 'my run 1'), ("it's; $(one).bag", "it's; $(one)"),
    ('noext', 'noext_ros2'), ('run.v1.bag', 'run.v1'), ('x.bag.bag', 'x_ros2'),
    ('there.bag', 'there_ros2'),
])  # fmt: skip
def test_the_command_that_converts_a_ros_1_bag_can_be_pasted(tmp_path, name, target):
    folder = tmp_path / 'my flight'
    (folder / 'there').mkdir(parents=True)
    path = folder / name
    path.write_bytes(b'#ROSBAG V2.0\n')
    with pytest.raises(RecordingError) as refusal:
        open_bag(path)
    _, _, command = one_line(refusal.value).partition('; convert it first: ')
    assert shlex.split(command) == [
        'rosbags-convert', '--src', str(path), '--dst', str(folder / target)
    ]  # fmt: skip


def test_every_refusal_is_one_line(tmp_path):
    for name, content in {'a.mcap': b'', 'b.mcap': b'\n\n\nxxxxxx', 'c\nd.bag': b'x'}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RecordingError) as caught:
            open_bag(tmp_path / name)
        if '\n' not in name:
            one_line(caught.value)


def test_an_empty_bag_opens_and_a_topic_of_it_is_refused(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run', frames=0))
    assert list(bag.messages()) == []
    assert bag.topics == {}
    assert (bag.start_ns, bag.end_ns) == (0, 0)
    assert bag.complete
    with pytest.raises(RecordingError, match=r'run: holds no messages; record it again or pass'):
        bag.require_topic([CAMERA])


def test_the_first_topic_of_several_is_chosen(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run', frames=1))
    assert bag.require_topic(['/not/there', SPEED, CAMERA]) == SPEED


def test_the_error_for_a_missing_topic_lists_the_present_ones(tmp_path):
    bag = open_bag(write_times(tmp_path / 'x.mcap', [1]))
    with pytest.raises(RecordingError) as caught:
        bag.require_topic(['/nanorocks/camera/image_raw'])
    assert one_line(caught.value) == (
        f"{tmp_path}/x.mcap: no topic '/nanorocks/camera/image_raw' "
        f"(found '/time' [{TIME_TYPE}]); pass --image-topic"
    )


def test_bytes_that_do_not_fit_their_type_are_refused(tmp_path, record):
    bag = open_bag(record(tmp_path / 'run', frames=1))
    message = next(iter(bag.messages([CAMERA])))
    for length in itertools.chain(range(0, 60), [1000]):
        truncated = BagMessage(
            topic=message.topic,
            type=message.type,
            log_time_ns=message.log_time_ns,
            cdr=message.cdr[:length],
        )
        with pytest.raises(
            RecordingError, match=r'is not a valid sensor_msgs/msg/CompressedImage'
        ) as caught:
            bag.deserialize(truncated)
        assert caught.value.__cause__ is not None
        one_line(caught.value)


@pytest.mark.parametrize(('encoding', 'text', 'problem'), [
    ('cdr', b'', 'is unknown'),
    ('cdr', b'nonsense ((', 'is unknown'),
    ('json', b'int32 a', "is encoded as 'json', not cdr"),
])  # fmt: skip
def test_an_unknown_type_is_refused(tmp_path, encoding, text, problem):
    writer = McapWriter(str(tmp_path / 'x.mcap'))
    writer.start()
    schema = writer.register_schema('my_msgs/msg/Odd', 'ros2msg', text)
    writer.add_message(writer.register_channel('/odd', encoding, schema), 1, b'1234', 1)
    writer.finish()
    bag = open_bag(tmp_path / 'x.mcap')
    with pytest.raises(RecordingError, match=problem) as caught:
        bag.deserialize(next(iter(bag.messages())))
    one_line(caught.value)


# --- bounded memory -------------------------------------------------------------------------


def test_a_long_bag_is_read_chunk_by_chunk(tmp_path, record, monkeypatch):
    """At most two chunks are in memory: the current one and the next."""
    path = record(tmp_path / 'run', frames=400)
    for content in (None, -30):
        file = path / 'run.mcap'
        file.write_bytes(file.read_bytes()[:content])
        bag = open_bag(path)
        loaded: list[int] = []

        def counting(stream, block, catalogue, loaded=loaded):
            messages = load(stream, block, catalogue)
            loaded.append(len(messages))
            return messages

        with monkeypatch.context() as patch:
            patch.setattr(mcap_file, 'load', counting)
            for count, _ in enumerate(bag.messages(), start=1):
                assert sum(loaded) - count <= 2 * max(loaded)
        assert len(loaded) >= 8


@pytest.mark.parametrize('chunked', [True, False])
@pytest.mark.parametrize('ended', [True, False])
def test_messages_with_impossible_times_are_skipped_and_counted(tmp_path, chunked, ended):
    path = tmp_path / 'x.mcap'
    writer = McapWriter(str(path), use_chunking=chunked, enable_crcs=False)
    writer.start()
    schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
    channel = writer.register_channel('/empty', 'cdr', schema)
    for stamp in (5, 6, 2**63 + 7, 8, 2**63 - 1, LAST_NS):
        writer.add_message(channel, stamp, b'\0\1\0\0\0', stamp)
    writer.finish()
    if not ended:
        path.write_bytes(path.read_bytes()[:-40])
    bag = open_bag(path)
    for _ in range(2):
        assert [message.log_time_ns for message in bag.messages()] == [5, 6, 8, LAST_NS]
        assert bag.messages_lost == 2
        assert not bag.complete
        assert bag.notices[-1] == f'{path}: 2 messages with impossible time stamps were skipped'
    assert (bag.start_ns, bag.end_ns) == (5, LAST_NS)


@pytest.mark.parametrize('count', [80, 82])
def test_a_count_that_metadata_contradicts_is_told(tmp_path, record, count):
    path = record(tmp_path / 'run')
    file = path / 'metadata.yaml'
    text = file.read_text()
    assert text.count('message_count: 81') == 2
    file.write_text(text.replace('message_count: 81', f'message_count: {count}'))
    bag = open_bag(path)
    assert not bag.complete
    assert f'{path}: metadata.yaml counts {count} messages, the files hold 81' in bag.notices


def test_a_file_that_is_listed_three_times_is_read_once(tmp_path, record):
    path = record(tmp_path / 'run')
    file = path / 'metadata.yaml'
    text = file.read_text()
    name = '  - run.mcap\n'
    assert text.count(name) == 1
    file.write_text(text.replace(name, 3 * name))
    bag = open_bag(path)
    assert bag.complete
    assert len(list(bag.messages())) == 81


@pytest.mark.parametrize('make', [os.symlink, os.link])
def test_a_file_with_a_second_name_is_read_once_and_told(tmp_path, record, make):
    path = record(tmp_path / 'run')
    make(path / 'run.mcap', path / 'run_1.mcap')
    file = path / 'metadata.yaml'
    file.write_text(file.read_text().replace('  - run.mcap\n', '  - run.mcap\n  - run_1.mcap\n'))
    bag = open_bag(path)
    assert len(list(bag.messages())) == 81
    assert bag.notices == (
        f'{path / "run_1.mcap"}: is run.mcap under another name; it is read once',
    )
    assert bag.complete


def test_of_many_missing_files_a_few_are_named(tmp_path, record):
    path = record(tmp_path / 'run')
    file = path / 'metadata.yaml'
    listed = ''.join(f'  - f{number}.mcap\n' for number in range(1000))
    file.write_text(file.read_text().replace('  - run.mcap\n', f'{listed}  - run.mcap\n'))
    bag = open_bag(path)
    assert not bag.complete
    assert len(bag.notices) == 6
    assert bag.notices[-1] == f'{path}: 995 more of its files are missing'


def test_provenance_that_differs_from_its_copy_is_told(tmp_path, record):
    path = record(tmp_path / 'run')
    file = path / 'metadata.yaml'
    file.write_text(file.read_text().replace("tray: '3'", "tray: '5'"))
    (notice,) = open_bag(path).notices
    assert 'its provenance differs from the copy in run.mcap' in notice


@pytest.mark.parametrize('place', ['metadata.yaml', 'run.mcap'])
def test_a_pipe_in_the_place_of_a_file_is_refused_at_once(tmp_path, record, place):
    path = record(tmp_path / 'run')
    (path / place).unlink()
    os.mkfifo(path / place)
    if place == 'metadata.yaml':
        assert 'is no regular file' in open_bag(path).notices[0]
    else:
        with pytest.raises(RecordingError):
            open_bag(path / place)


def test_a_view_in_the_place_of_a_table_is_refused(tmp_path):
    """It may count for ever."""
    folder = write_with_rosbags(tmp_path / 'run', StoragePlugin.SQLITE3)
    file = next(folder.glob('*.db3'))
    with closing(sqlite3.connect(file)) as database, database:
        database.execute('ALTER TABLE messages RENAME TO old')
        database.execute(
            'CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 '
            "FROM n) SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n"
        )
    with pytest.raises(RecordingError, match="holds 'messages' as a view, not as a table"):
        open_bag(folder)


def test_a_query_that_takes_too_long_ends(tmp_path, monkeypatch):
    folder = write_with_rosbags(tmp_path / 'run', StoragePlugin.SQLITE3)
    file = next(folder.glob('*.db3'))
    with closing(sqlite3.connect(file)) as database, database:
        database.execute(
            'INSERT INTO messages(topic_id, timestamp, data) WITH RECURSIVE n(i) AS (SELECT 9 '
            "UNION ALL SELECT i + 1 FROM n LIMIT 50000) SELECT 1, i, x'00' FROM n"
        )
    assert len(list(open_bag(file).messages())) == 50_003
    monkeypatch.setenv('NANOROCKS_MAX_SQLITE_STEPS', '1')
    try:
        bag = open_bag(file)
    except RecordingError as error:
        one_line(error)
    else:
        assert not bag.complete
