"""Intact messages that somebody finds in a damaged MCAP file: the peers of a salvage."""

from __future__ import annotations

import struct
from io import BytesIO
from typing import TYPE_CHECKING

import lz4.frame
import zstandard
from mcap.reader import NonSeekingReader, SeekingReader

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

_RECORD = struct.Struct('<BQ')
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 3, 4, 5, 6
_TYPES = (b'sensor_msgs/msg/CompressedImage', b'builtin_interfaces/msg/Time')
_MAGIC_BYTES = 8
_TOPICS = (b'/camera', b'/epoch')
_HEAD = struct.Struct('<HIQQ')
_CHUNK_HEAD = struct.Struct('<QQQII')
_LIMIT = 1 << 26

Key = tuple[int, bytes]
"""Log time and content of a message."""


def found_by_library(content: bytes, intact: Collection[Key]) -> set[Key]:
    """What the `mcap` library reads, by its index and from the front."""
    keys: set[Key] = set()
    for reader in (SeekingReader, NonSeekingReader):
        try:
            source = reader(BytesIO(content), record_size_limit=_LIMIT)
            for _, _, message in source.iter_messages(log_time_order=False):
                keys.add((message.log_time, message.data))
        except Exception:  # whatever it raises, it reads no further
            continue
    return keys & set(intact)


def found_record_by_record(content: bytes, intact: Collection[Key]) -> set[Key]:
    """What a plain walk over the records finds, chunk by chunk.

    A message counts if the walk finds its topic and its type, too: without them it is nothing.
    """
    found: list[tuple[int, Key]] = []
    channels: dict[int, int] = {}
    types: set[int] = set()
    for opcode, record in _records(content[_MAGIC_BYTES:]):
        inner = _records(_unpacked(record)) if opcode == _CHUNK else ((opcode, record),)
        for kind, part in inner:
            if kind == _MESSAGE and len(part) >= _HEAD.size:
                channel, _, stamp_ns, _ = _HEAD.unpack_from(part)
                found.append((channel, (stamp_ns, part[_HEAD.size :])))
            elif kind == _CHANNEL and any(topic in part for topic in _TOPICS):
                channel, schema = struct.unpack_from('<HH', part)
                channels[channel] = schema
            elif kind == _SCHEMA and any(name in part for name in _TYPES):
                types.add(int.from_bytes(part[:2], 'little'))
    return {key for channel, key in found if channels.get(channel) in types} & set(intact)


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        if start + length > len(data):
            return
        yield opcode, data[start : start + length]
        position = start + length


def _unpacked(chunk: bytes) -> bytes:
    try:
        *_, size, _, length = _CHUNK_HEAD.unpack_from(chunk)
        name = chunk[_CHUNK_HEAD.size :][:length]
        data = chunk[_CHUNK_HEAD.size + length + 8 :]
        if name == b'zstd':
            return zstandard.decompress(data, max_output_size=min(size, _LIMIT))
        return bytes(lz4.frame.decompress(data)) if name == b'lz4' else data
    except (struct.error, RuntimeError, ValueError, MemoryError, zstandard.ZstdError):
        return b''
