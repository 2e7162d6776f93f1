"""Salvage of damaged recordings: every readable message is copied."""

from __future__ import annotations

import gc
import hashlib
import os
import re
import shutil
import sqlite3
import tempfile
from contextlib import closing

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.salvage import salvage
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.studies.inspection.bag_info import bag_info

SPEED = '/nanorocks/tray_3/speed'
CAMERA = '/nanorocks/camera/image_raw/compressed'
IMAGE = 'sensor_msgs/msg/CompressedImage'


def salvaged(source, target):
    """Salvage; check that the source is unchanged and the new recording complete."""
    before = {file: hashlib.sha256(file.read_bytes()).digest() for file in files(source)}
    result = salvage(source, target, lambda done, total: None)
    assert {file: hashlib.sha256(file.read_bytes()).digest() for file in files(source)} == before
    bag = open_bag(target)
    assert bag.complete
    assert bag.notices == ()
    messages = list(bag.messages())
    assert len(messages) == result.recovered
    if {info.encoding for info in bag.topics.values()} == {'cdr'}:
        with Reader(target) as reader:
            assert reader.message_count == result.recovered
    return result, messages


def files(path):
    return [file for file in path.rglob('*') if file.is_file()] if path.is_dir() else [path]


def chunks(path):
    with path.open('rb') as stream:
        return make_reader(stream).get_summary().chunk_indexes


def test_a_whole_recording_is_copied_message_by_message(tmp_path, record):
    path = record(tmp_path / 'run')
    result, messages = salvaged(path, tmp_path / 'new')
    assert (result.recovered, result.lost) == (81, 0)
    assert messages == list(open_bag(path).messages())
    old, new = open_bag(path), open_bag(tmp_path / 'new')
    assert {k: (v.type, v.qos) for k, v in new.topics.items()} == {
        k: (v.type, v.qos) for k, v in old.topics.items()
    }
    assert old.metadata.items() <= new.metadata.items()
    assert new.metadata['salvaged_from'] == 'run'


@pytest.mark.parametrize('share', [0.3, 0.6, 0.95, 0.999])
def test_messages_before_a_cut_are_recovered_and_the_others_counted(tmp_path, record, share):
    path = record(tmp_path / 'run', frames=100, size=9000)
    everything = list(open_bag(path).messages())
    file = path / 'run.mcap'
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    result, messages = salvaged(path, tmp_path / 'new')
    assert messages == everything[: len(messages)]
    assert result.recovered + result.lost == len(everything) == 201
    assert result.recovered > (share - 0.2) * 201


def test_without_metadata_and_without_an_end(tmp_path, record):
    path = record(tmp_path / 'run', frames=100, size=9000)
    (path / 'metadata.yaml').unlink()
    result, _ = salvaged(path, tmp_path / 'new')
    assert (result.recovered, result.lost) == (201, 0)
    # The MCAP file contains a copy of metadata.yaml.
    assert open_bag(tmp_path / 'new').metadata['tray'] == '3'
    file = path / 'run.mcap'
    file.write_bytes(file.read_bytes()[:-100])
    result, _ = salvaged(path, tmp_path / 'newer')
    assert result.recovered == 201


@pytest.mark.parametrize('ended', [True, False])
@pytest.mark.parametrize('number', range(3))
@pytest.mark.parametrize('place', [1, 6, 'middle'])
def test_a_damaged_chunk_costs_its_own_messages_alone(tmp_path, record, ended, number, place):
    """The damage is in its length or in its middle."""
    path = record(tmp_path / 'run', frames=100, size=9000)
    everything = list(open_bag(path).messages())
    file = path / 'run.mcap'
    whole = bytearray(file.read_bytes())
    indexes = chunks(file)
    number = min(number, len(indexes) - 1)
    chunk = indexes[number]
    at = chunk.chunk_length // 2 if place == 'middle' else place
    whole[chunk.chunk_start_offset + at] ^= 0x55
    file.write_bytes(whole if ended else whole[:-40])
    result, messages = salvaged(path, tmp_path / 'new')
    assert [message for message in everything if message in messages] == messages
    outside = [
        message
        for message in everything
        if not chunk.message_start_time <= message.log_time_ns <= chunk.message_end_time
    ]
    assert [message for message in messages if message in outside] == outside
    assert result.recovered + result.lost == len(everything)


def changed(path, start, content, cut=0):
    """Overwrite bytes of a file, and cut its end."""
    whole = bytearray(path.read_bytes())
    whole[start : start + len(content)] = content
    path.write_bytes(whole[: len(whole) - cut])


@pytest.mark.parametrize('cut', [0, 40])
def test_an_impossible_length_inside_a_chunk_costs_nothing(tmp_path, record, cut):
    """The length of its record says where it ends."""
    path = record(tmp_path / 'run', frames=100, size=9000)
    everything = list(open_bag(path).messages())
    # The highest byte of the length of the records, behind times, size, checksum and 'zstd'.
    changed(path / 'run.mcap', chunks(path / 'run.mcap')[1].chunk_start_offset + 52, b'\xff', cut)
    result, messages = salvaged(path, tmp_path / 'new')
    assert messages == everything
    assert result.lost == 0
    assert any('damaged heads were read all the same' in notice for notice in result.notices)


@pytest.mark.parametrize('cut', [0, 40])
@pytest.mark.parametrize('content', [b'\x00', b'\x89LCAP0\r\n', bytes(8)])
def test_an_mcap_file_that_is_damaged_in_its_first_bytes_is_read(tmp_path, record, content, cut):
    path = record(tmp_path / 'run', frames=100, size=9000)
    everything = list(open_bag(path).messages())
    changed(path / 'run.mcap', 0, content, cut)
    result, messages = salvaged(path, tmp_path / 'new')
    assert messages == everything
    assert result.lost == 0
    assert f'{path}/run.mcap: its first bytes are damaged; the rest is read' in result.notices
    # Without salvaging the file is refused.
    with pytest.raises(RecordingError, match='is not an MCAP file') as refusal:
        open_bag(path)
    remedy = 'pass a rosbag2 folder' if cut else 'ends like an MCAP file; run nanorocks salvage'
    assert remedy in str(refusal.value)


@pytest.mark.parametrize('cut', [0, 8])
def test_a_first_sector_that_is_lost_costs_its_chunk_alone(tmp_path, record, cut):
    """Topics and types in the first sector are repeated at the end of the file."""
    path = record(tmp_path / 'run', frames=100, size=9000)
    everything = list(open_bag(path).messages())
    first, second, *_ = chunks(path / 'run.mcap')
    changed(path / 'run.mcap', 0, bytes(512), cut)
    result, messages = salvaged(path, tmp_path / 'new')
    assert first.chunk_start_offset < 512
    assert messages == everything[-len(messages) :]
    assert messages[0].log_time_ns == second.message_start_time
    assert result.recovered + result.lost == 201
    assert set(open_bag(tmp_path / 'new').topics) == {CAMERA, SPEED}


@pytest.mark.parametrize('size', [3, 600, 3_000_000])
def test_a_file_that_is_not_mcap_is_refused(tmp_path, size):
    noise = np.random.default_rng(2).bytes(size)
    (tmp_path / 'x.mcap').write_bytes(noise)
    with pytest.raises(RecordingError, match=r'is not an MCAP file \(begins with .*\); pass a'):
        salvage(tmp_path / 'x.mcap', tmp_path / 'new', lambda *_: None)


def write_unknown(path, encoding, text):
    writer = McapWriter(str(path))
    writer.start()
    schema = writer.register_schema('my_msgs/msg/Odd', 'ros2msg', text)
    writer.add_message(writer.register_channel('/odd', encoding, schema), 5, b'1234', 5)
    writer.finish()
    return path


@pytest.mark.parametrize(('encoding', 'text'), [('cdr', b'nonsense (('), ('json', b'')])
def test_messages_of_unknown_types_are_copied(tmp_path, encoding, text):
    path = write_unknown(tmp_path / 'x.mcap', encoding, text)
    _, (message,) = salvaged(path, tmp_path / 'new')
    assert message.cdr == b'1234'
    info = open_bag(tmp_path / 'new').topics['/odd']
    assert (info.type, info.encoding, info.definition) == (
        'my_msgs/msg/Odd',
        encoding,
        text.decode(),
    )


def write_sqlite(path, count, size=3000):
    store = get_typestore(Stores.ROS2_JAZZY)
    noise = np.random.default_rng(1)
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection(CAMERA, IMAGE, typestore=store)
        for stamp in range(1, count + 1):
            message = compressed_image_message(stamp, 'camera', 'jpeg', noise.bytes(size))
            writer.write(connection, stamp, store.serialize_cdr(message, IMAGE))
    return path


def test_readable_rows_of_a_sqlite_file_are_recovered(tmp_path):
    path = write_sqlite(tmp_path / 'run', 100)
    everything = list(open_bag(path).messages())
    file = next(path.glob('*.db3'))
    content = file.read_bytes()
    assert salvaged(path, tmp_path / 'whole')[1] == everything
    file.write_bytes(content[: int(0.6 * len(content)) // 4096 * 4096])
    result, messages = salvaged(path, tmp_path / 'cut')
    assert 40 <= len(messages) <= 70
    assert [message for message in everything if message in messages] == messages
    assert result.recovered + result.lost == 100
    file.write_bytes(content[:81920] + bytes(40960) + content[122880:])
    result, messages = salvaged(path, tmp_path / 'hole')
    assert 70 <= len(messages) < 100
    assert result.recovered + result.lost == 100


def test_the_target_is_not_overwritten(tmp_path, record):
    path = record(tmp_path / 'run', frames=2)
    with pytest.raises(RecordingError, match='exists already and is not overwritten'):
        salvage(path, path, lambda *_: None)
    assert len(list(open_bag(path).messages())) == 5


@pytest.mark.parametrize('content', [b'\x89MCAP0\r\n', b'\x89MCAP0\r\n' + bytes(500)])
def test_without_readable_messages_no_recording_is_written(tmp_path, content):
    (tmp_path / 'x.mcap').write_bytes(content)
    with pytest.raises(RecordingError, match='holds no message that can be recovered'):
        salvage(tmp_path / 'x.mcap', tmp_path / 'new', lambda *_: None)
    assert not (tmp_path / 'new').exists()


@pytest.mark.parametrize('share', [0.05, 0.2, 0.5, 0.9])
def test_a_damaged_page_of_a_sqlite_file_costs_its_own_rows_alone(tmp_path, share):
    path = write_sqlite(tmp_path / 'run', 400, size=60_000)
    everything = list(open_bag(path).messages())
    file = next(path.glob('*.db3'))
    content = bytearray(file.read_bytes())
    start = int(share * len(content)) // 4096 * 4096
    content[start : start + 4096] = bytes(4096)
    file.write_bytes(content)
    bag = open_bag(path)
    for _ in range(2):
        result = list(bag.messages())
        assert [message for message in everything if message in result] == result
        assert len(result) >= 400 - 8
        assert len(result) + bag.messages_lost == 400
    assert not bag.complete
    result, messages = salvaged(path, tmp_path / 'new')
    assert len(messages) >= 400 - 8
    assert result.recovered + result.lost == 400


def test_a_damaged_index_of_a_sqlite_file_costs_no_messages(tmp_path):
    path = write_sqlite(tmp_path / 'run', 2000, size=30)
    everything = list(open_bag(path).messages())
    file = next(path.glob('*.db3'))
    content = bytearray(file.read_bytes())
    leaves = [place for place in range(0, len(content), 4096) if content[place] == 0x0A]
    content[leaves[-2] : leaves[-2] + 4096] = bytes(4096)
    file.write_bytes(content)
    result, messages = salvaged(path, tmp_path / 'new')
    assert messages == everything
    assert result.lost == 0
    assert 'damaged' in result.notices[0]


@pytest.mark.parametrize('change', [
    'timestamp = -timestamp', "timestamp = 'soon'", 'timestamp = timestamp + 0.5',
    "data = 'hello'", "data = CAST(x'ff00' AS TEXT)", 'topic_id = 77', "topic_id = 'x'",
])  # fmt: skip
@pytest.mark.parametrize('damaged', [False, True])
def test_a_row_with_invalid_values_is_skipped(tmp_path, change, damaged):
    path = write_sqlite(tmp_path / 'run', 60, size=20_000)
    everything = list(open_bag(path).messages())
    file = next(path.glob('*.db3'))
    with closing(sqlite3.connect(file)) as database, database:
        database.execute(f'UPDATE messages SET {change} WHERE id = 10')
    if damaged:
        content = bytearray(file.read_bytes())
        # A page in the middle of a row, which links to the next page of the row.
        starts = range(len(content) // 8192 * 4096, len(content), 4096)
        start = next(k for k in starts if content[k : k + 4] == (k // 4096 + 2).to_bytes(4, 'big'))
        content[start : start + 4096] = bytes(4096)
        file.write_bytes(content)
    result, messages = salvaged(path, tmp_path / 'new')
    assert everything[9] not in messages
    assert [message for message in everything if message in messages] == messages
    assert result.recovered + result.lost == 60
    assert result.recovered >= (55 if damaged else 59)
    notice = 'run.db3: 1 messages with an invalid time, topic or content were skipped'
    assert damaged or result.notices == (f'{path}/{notice}',)
    report = bag_info(path, lambda *_: None)
    assert not report.complete
    assert report.messages_lost == result.lost


def test_a_damaged_row_is_skipped_even_if_the_index_has_its_time(tmp_path):
    path = write_sqlite(tmp_path / 'run', 60)
    file = next(path.glob('*.db3'))
    with closing(sqlite3.connect(file)) as database, database:
        database.execute('UPDATE messages SET timestamp = timestamp + (1 << 50)')
    content = bytearray(file.read_bytes())
    # The types in the head of a row: one bit makes a floating-point number of its time.
    heads = re.finditer(rb'\x06\x00[\x01\x09]\x06[\x80-\xff][\x00-\x7f]', bytes(content))
    content[next(heads).start() + 3] ^= 1
    file.write_bytes(content)
    result, messages = salvaged(path, tmp_path / 'new')
    assert (result.recovered, result.lost, len(messages)) == (59, 1, 59)


@pytest.mark.parametrize('unmerged', [False, True])
def test_a_sqlite_file_with_a_log_beside_it_is_read_and_not_touched(
    tmp_path, monkeypatch, unmerged
):
    scratch = tmp_path / 'scratch'
    scratch.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(scratch))
    path = write_sqlite(tmp_path / 'run', 60)
    file = next(path.glob('*.db3'))
    left = tmp_path / 'left'
    with closing(sqlite3.connect(file)) as database:
        database.execute('PRAGMA journal_mode=WAL')
        with database:
            database.execute('DELETE FROM messages WHERE id = 60')
        # As left by a killed recorder.
        shutil.copytree(path, left)
    if not unmerged:
        shutil.rmtree(left)
        shutil.copytree(path, left)
    before = sorted(os.listdir(left))
    assert ('run.db3-wal' in before) == unmerged
    for bag in (left, left / 'run.db3'):
        reader = open_bag(bag)
        assert len(list(reader.messages())) == 59
        # The folder says that there were 60.
        assert reader.complete == (bag != left)
        del reader
    salvaged(left, tmp_path / 'new')
    assert sorted(os.listdir(left)) == before
    gc.collect()
    assert not list(scratch.iterdir())


def test_lost_definitions_cost_no_messages(tmp_path):
    path = write_sqlite(tmp_path / 'run', 20)
    everything = list(open_bag(path).messages())
    file = next(path.glob('*.db3'))
    with closing(sqlite3.connect(file)) as database:
        ((page,),) = database.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'message_definitions'"
        )
    content = bytearray(file.read_bytes())
    content[(page - 1) * 4096 : page * 4096] = bytes(4096)
    file.write_bytes(content)
    assert salvaged(path, tmp_path / 'new')[1] == everything


def test_rows_behind_a_hole_of_thousands_are_found(tmp_path):
    path = write_sqlite(tmp_path / 'run', 6000, size=30)
    file = next(path.glob('*.db3'))
    with closing(sqlite3.connect(file)) as database, database:
        database.execute('DELETE FROM messages WHERE id BETWEEN 100 AND 5000')
    content = bytearray(file.read_bytes())
    leaves = [place for place in range(0, len(content), 4096) if content[place] == 0x0D]
    content[leaves[-2] : leaves[-2] + 4096] = bytes(4096)
    file.write_bytes(content)
    result = salvage(path, tmp_path / 'new', lambda *_: None)
    assert result.recovered > 1000


def interrupted(source, target):
    """Ctrl-C before the end."""

    def progress(done, total):
        if done > total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        salvage(source, target, progress)


def test_an_interrupted_salvage_is_not_complete(tmp_path, record):
    path = record(tmp_path / 'run')
    interrupted(path, tmp_path / 'part')
    part = open_bag(tmp_path / 'part')
    assert 40 <= len(list(part.messages())) < 81
    assert part.metadata['salvage'] == 'unfinished'
    assert not part.complete
    notice = 'holds only part of the readable messages because its salvage was interrupted'
    assert part.notices == (f'{tmp_path / "part"}: {notice}',)
    # A copy of it is unfinished, too.
    result = salvage(tmp_path / 'part', tmp_path / 'copy', lambda *_: None)
    assert result.notices == part.notices
    assert not open_bag(tmp_path / 'copy').complete
    salvaged(path, tmp_path / 'new')
    assert open_bag(tmp_path / 'new').metadata['salvage'] == 'complete'
