"""Damaged MCAP files: nothing is lost silently, and every intact message is salvaged."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.salvage import salvage
from nanorocks_ros.recordings.mcap import mcap_scan
from nanorocks_ros.recordings.mcap.mcap_resync import next_record

LAYOUTS = {
    'zstd': {'compression': CompressionType.ZSTD},
    'lz4': {'compression': CompressionType.LZ4},
    'plain': {'compression': CompressionType.NONE},
    'unchunked': {'use_chunking': False},
}
COUNT = 60


def write(path, layout='zstd', **options):
    noise = np.random.default_rng(1)
    writer = McapWriter(str(path), **{'chunk_size': 2000, **LAYOUTS[layout], **options})
    writer.start()
    schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
    channel = writer.register_channel('/text', 'cdr', schema)
    for stamp in range(1, COUNT + 1):
        writer.add_message(channel, stamp, noise.bytes(120 + 7 * (stamp % 5)), stamp)
    writer.finish()
    return path


def chunks(path):
    with path.open('rb') as stream:
        return make_reader(stream).get_summary().chunk_indexes


def read(path):
    bag = open_bag(path)
    return bag, [m.log_time_ns for m in bag.messages()]


def salvaged(path, tmp_path):
    result = salvage(path, tmp_path / 'new', lambda *_: None)
    return result, [m.log_time_ns for m in open_bag(tmp_path / 'new').messages()]


def of_chunk(chunk):
    return [*range(chunk.message_start_time, chunk.message_end_time + 1)]


def change(path, edit):
    content = bytearray(path.read_bytes())
    path.write_bytes(edit(content) or content)


@pytest.mark.parametrize('bit', range(8))
@pytest.mark.parametrize('layout', ['zstd', 'plain'])
def test_a_flipped_bit_in_the_opcode_of_a_chunk_is_told_and_costs_a_salvage_nothing(
    tmp_path, layout, bit
):
    path = write(tmp_path / 'x.mcap', layout)
    second = chunks(path)[1]

    def flip(content):
        content[second.chunk_start_offset] ^= 1 << bit

    change(path, flip)
    bag, stamps = read(path)
    assert len(stamps) + bag.messages_lost == COUNT
    assert bag.messages_lost == len(of_chunk(second))
    assert not bag.complete
    assert bag.notices
    result, stamps = salvaged(path, tmp_path)
    assert stamps == [*range(1, COUNT + 1)]
    assert result.notices


def test_swapped_chunks_are_told_and_salvaged(tmp_path):
    path = write(tmp_path / 'x.mcap')
    first, *_, last = chunks(path)

    def swap(content):
        def part(chunk):
            start = chunk.chunk_start_offset
            return slice(start, start + chunk.chunk_length + chunk.message_index_length)

        a, b = part(first), part(last)
        return (
            content[: a.start] + content[b] + content[a.stop : b.start] + content[a]
            + content[b.stop :]
        )  # fmt: skip

    change(path, swap)
    bag, stamps = read(path)
    assert not bag.complete
    assert len(stamps) + bag.messages_lost >= COUNT
    _, stamps = salvaged(path, tmp_path)
    assert stamps == [*range(1, COUNT + 1)]


@pytest.mark.parametrize('layout', ['zstd', 'lz4', 'plain'])
@pytest.mark.parametrize('missing', [1, 40, 300])
def test_missing_bytes_cost_their_chunk_alone(tmp_path, layout, missing):
    path = write(tmp_path / 'x.mcap', layout)
    second = chunks(path)[1]
    start = second.chunk_start_offset + second.chunk_length // 2

    def delete(content):
        del content[start : start + missing]

    change(path, delete)
    bag, stamps = read(path)
    assert not bag.complete
    assert set(range(1, COUNT + 1)) - set(stamps) <= set(of_chunk(second))
    _, stamps = salvaged(path, tmp_path)
    assert set(range(1, COUNT + 1)) - set(stamps) <= set(of_chunk(second))
    if layout == 'plain':
        assert len(stamps) >= COUNT - 5


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('ended', [True, False])
def test_a_damaged_head_of_the_file_costs_what_it_covers(tmp_path, layout, ended):
    path = write(tmp_path / 'x.mcap', layout)

    def zero(content):
        content[8:60] = bytes(52)
        return content if ended else content[:-30]

    change(path, zero)
    _, stamps = salvaged(path, tmp_path)
    assert stamps[-1] == COUNT
    assert len(stamps) >= COUNT - 15


@pytest.mark.parametrize('layout', ['plain', 'lz4'])
def test_a_chunk_whose_checksum_is_wrong_is_salvaged_and_said(tmp_path, layout):
    path = write(tmp_path / 'x.mcap', layout)
    second = chunks(path)[1]

    def flip(content):
        content[second.chunk_start_offset + second.chunk_length - 30] ^= 1

    change(path, flip)
    bag, stamps = read(path)
    assert set(stamps).isdisjoint(of_chunk(second))
    assert bag.messages_lost == len(of_chunk(second))
    result, stamps = salvaged(path, tmp_path)
    assert stamps == [*range(1, COUNT + 1)]
    assert any('checksum or length is wrong' in notice for notice in result.notices)


def test_a_wrong_length_of_a_message_outside_chunks_is_told(tmp_path):
    path = write(tmp_path / 'x.mcap', 'unchunked')
    content = path.read_bytes()
    place = content.index(struct.pack('<IQQ', 0, 20, 20)) - 11
    assert content[place] == 5
    change(path, lambda c: c.__setitem__(place + 1, c[place + 1] ^ 0x20))
    result, stamps = salvaged(path, tmp_path)
    assert set(range(1, COUNT + 1)) - set(stamps) <= {20}
    assert result.lost >= 1
    assert result.notices


def test_a_count_that_differs_from_the_statistics_is_told(tmp_path):
    path = write(tmp_path / 'x.mcap', 'unchunked', use_summary_offsets=False)
    content = path.read_bytes()
    record = content.index(struct.pack('<IQQ', 0, 20, 20)) - 11
    length = struct.unpack_from('<Q', content, record + 1)[0] + 9
    path.write_bytes(content[:record] + content[record + length :])
    bag, stamps = read(path)
    assert len(stamps) == COUNT - 1
    assert not bag.complete
    assert bag.messages_lost == 1


def test_a_chunk_above_the_limit_is_left_out_and_the_setting_named(tmp_path, monkeypatch):
    path = write(tmp_path / 'x.mcap')
    monkeypatch.setenv('NANOROCKS_MAX_CHUNK_BYTES', '1000')
    bag, stamps = read(path)
    assert stamps == []
    assert bag.messages_lost == COUNT
    assert any('NANOROCKS_MAX_CHUNK_BYTES raises it' in notice for notice in bag.notices)


def test_our_own_bags_have_a_checksum_of_their_index(tmp_path, record):
    path = record(tmp_path / 'run') / 'run.mcap'
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert len(list(reader.iter_messages())) == 81
        footer = path.read_bytes()[-37:]
    assert struct.unpack_from('<I', footer, 25)[0]


@pytest.mark.parametrize('layout', ['unchunked', 'plain'])
def test_many_damages_are_looked_at_once_each(tmp_path, monkeypatch, layout):
    """However many there are, the bytes that are read grow with the size of the file alone."""
    path = write(tmp_path / 'x.mcap', layout)
    whole = path.read_bytes()
    start = chunks(path)[0].chunk_start_offset + 49 if layout == 'plain' else 42
    message = struct.pack('<BQHIQQ', 5, 22, 1, 0, 1, 1)
    hostile = (message * 4 + b'\xff') * 3000
    head = bytearray(whole[:start])
    if layout == 'plain':
        struct.pack_into('<Q', head, start - 8, len(hostile) + 10_000_000)
    path.write_bytes(bytes(head) + hostile + bytes(2_000_000))
    searched = 0

    def counting(stream, position, size, **options):
        nonlocal searched
        place = next_record(stream, position, size, **options)
        searched += (size if place is None else place) - position
        return place

    monkeypatch.setattr(mcap_scan, 'next_record', counting)
    with path.open('rb') as stream:
        size = path.stat().st_size
        index = mcap_scan.scan(stream, size, salvaging=True)
    assert index.total > 10_000
    assert searched < 5 * size
