"""MCAP files whose index or chunks claim more than there is, or hold more than a machine bears."""

from __future__ import annotations

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.salvage import salvage

MAGIC = b'\x89MCAP0\r\n'
COUNT = 40


def record(opcode, content):
    return struct.pack('<BQ', opcode, len(content)) + content


def write(path, sizes=(300,), stamps=range(1, COUNT + 1), chunk_size=2000):
    noise = np.random.default_rng(1)
    writer = McapWriter(str(path), chunk_size=chunk_size, compression=CompressionType.ZSTD)
    writer.start()
    schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
    channel = writer.register_channel('/text', 'cdr', schema)
    for number, stamp in enumerate(stamps):
        content = noise.bytes(100) + bytes(sizes[number % len(sizes)])
        writer.add_message(channel, stamp, content, stamp)
    writer.finish()
    return path


def summary_of(path):
    with path.open('rb') as stream:
        return make_reader(stream).get_summary()


def with_summary(path, change):
    """The same data with another index, whose checksum is right."""
    content = path.read_bytes()
    start, _, _ = struct.unpack_from('<QQI', content, len(content) - len(MAGIC) - 20)
    records, position = [], start
    while position < len(content) - len(MAGIC) - 29:
        opcode, length = struct.unpack_from('<BQ', content, position)
        records.append((opcode, content[position + 9 : position + 9 + length]))
        position += 9 + length
    summary = b''.join(record(*each) for each in change(records))
    footer = struct.pack('<BQQQ', 2, 20, start, 0)
    checksum = struct.pack('<I', zlib.crc32(summary + footer))
    path.write_bytes(content[:start] + summary + footer + checksum + MAGIC)
    return path


def read(path):
    bag = open_bag(path)
    return bag, [message.log_time_ns for message in bag.messages()]


def chunk_of(records, packed=None):
    packed = zstandard.ZstdCompressor().compress(records) if packed is None else packed
    head = struct.pack('<QQQI', 1, 1, len(records), zlib.crc32(records))
    return record(6, head + b'\4\0\0\0zstd' + struct.pack('<Q', len(packed)) + packed)


def file_of(path, *chunks):
    """A file without an index."""
    schema = struct.pack('<HI', 1, 19) + b'std_msgs/msg/String' + struct.pack('<I', 7) + b'ros2msg'
    channel = struct.pack('<HHI', 1, 1, 5) + b'/text' + struct.pack('<I', 3) + b'cdr' + bytes(4)
    head = MAGIC + record(1, bytes(8)) + record(3, schema + bytes(4)) + record(4, channel)
    end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
    path.write_bytes(head + b''.join(chunks) + end)
    return path


def message(stamp, content=b''):
    return record(5, struct.pack('<HIQQ', 1, 0, stamp, stamp) + content)


def test_a_chunk_that_is_listed_twice_is_read_once(tmp_path):
    path = write(tmp_path / 'x.mcap')

    def twice(records):
        for opcode, content in records:
            if opcode == 11:
                (chunks,) = struct.unpack_from('<I', content, 22)
                content = content[:22] + struct.pack('<I', 2 * chunks) + content[26:]
            yield opcode, content
            if opcode == 8:
                yield opcode, content

    with_summary(path, twice)
    summary = summary_of(path)
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count
    bag, stamps = read(path)
    assert stamps == [*range(1, COUNT + 1)]
    assert bag.topics['/text'].count == COUNT


@pytest.mark.parametrize('times', [(10**15, 5), (0, COUNT), (1, 10**15)])
def test_statistics_with_other_times_than_the_chunks_do_not_stretch_a_recording(tmp_path, times):
    path = write(tmp_path / 'x.mcap')

    def stretch(records):
        for opcode, content in records:
            if opcode == 11:
                content = content[:26] + struct.pack('<QQ', *times) + content[42:]
            yield opcode, content

    with_summary(path, stretch)
    statistics = summary_of(path).statistics
    assert (statistics.message_start_time, statistics.message_end_time) == times
    bag, _ = read(path)
    assert (bag.start_ns, bag.end_ns) == (1, COUNT)


def test_overlapping_chunks_above_the_limit_are_told_with_the_variable(tmp_path, monkeypatch):
    # Each chunk lasts from the first half to the last.
    stamps = [stamp for number in range(8) for stamp in (1 + number, 1001 + number)]
    path = write(tmp_path / 'x.mcap', (50_000,), stamps, chunk_size=100_000)
    assert len(summary_of(path).chunk_indexes) == 8
    whole, all_stamps = read(path)
    assert whole.complete
    monkeypatch.setenv('NANOROCKS_MAX_OVERLAP_BYTES', '450000')
    bag, some = read(path)
    assert len(some) == 8
    assert set(some) < set(all_stamps)
    assert bag.messages_lost == 8
    assert not bag.complete
    assert 'NANOROCKS_MAX_OVERLAP_BYTES raises it' in '\n'.join(bag.notices)


def test_chunks_one_after_the_other_do_not_add_up(tmp_path, monkeypatch):
    path = write(tmp_path / 'x.mcap', (50_000,), chunk_size=100_000)
    monkeypatch.setenv('NANOROCKS_MAX_OVERLAP_BYTES', '250000')
    bag, stamps = read(path)
    assert stamps == [*range(1, COUNT + 1)]
    assert bag.complete


@pytest.mark.parametrize('content', [message(1), record(4, bytes(17))])
def test_a_million_records_in_a_few_bytes_are_refused_with_the_variable(tmp_path, content):
    path = file_of(tmp_path / 'x.mcap', chunk_of(message(1) + content * 300_000))
    assert path.stat().st_size < 5000
    bag, stamps = read(path)
    assert stamps == []
    assert not bag.complete
    assert 'NANOROCKS_MAX_RECORD_RATIO raises it' in '\n'.join(bag.notices)
    few = file_of(tmp_path / 'few.mcap', chunk_of(message(1) * 900))
    assert len(read(few)[1]) == 900


def test_a_chunk_that_is_packed_too_well_names_the_variable_and_fills_no_memory(tmp_path):
    path = file_of(tmp_path / 'x.mcap', chunk_of(message(1, bytes(70 << 20))))
    tracemalloc.start()
    bag, _ = read(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 'NANOROCKS_MAX_CHUNK_RATIO raises it' in '\n'.join(bag.notices)
    assert peak < 50 << 20


def test_a_recording_behind_another_is_told(tmp_path):
    first, second = write(tmp_path / 'a.mcap'), write(tmp_path / 'b.mcap', (90,), range(500, 540))
    both = tmp_path / 'x.mcap'
    both.write_bytes(first.read_bytes() + second.read_bytes())
    size = second.stat().st_size
    result = salvage(both, tmp_path / 'new', lambda *_: None)
    assert result.recovered == COUNT
    assert f'the last {size} bytes stand behind its end' in '\n'.join(result.notices)
    bag, _ = read(both)
    assert not bag.complete
    tail = tmp_path / 'tail.mcap'
    tail.write_bytes(both.read_bytes()[-size:])
    assert read(tail)[1] == [*range(500, 540)]
