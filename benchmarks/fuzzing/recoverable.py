"""Intact messages that somebody finds in a damaged MCAP file: the peers of a salvage."""

from __future__ import annotations

import struct
from io import BytesIO
from typing import TYPE_CHECKING

import lz4.frame
import zstandard
from mcap.reader import NonSeekingReader, SeekingReader

if TYPE_CHECKING:
    from collections.abc import Collection

_RECORD = struct.Struct('<BQ')
_MESSAGE, _CHUNK = 5, 6
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
    """What a plain walk over the records finds, chunk by chunk."""
    keys: set[Key] = set()
    position = 8
    while position + _RECORD.size <= len(content):
        opcode, length = _RECORD.unpack_from(content, position)
        start = position + _RECORD.size
        if start + length > len(content):
            break
        if opcode == _MESSAGE:
            _add(content[start : start + length], keys)
        elif opcode == _CHUNK:
            _walk(_unpacked(content[start : start + length]), keys)
        position = start + length
    return keys & set(intact)


def _walk(data: bytes, keys: set[Key]) -> None:
    position = 0
    while position + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        if start + length > len(data):
            return
        if opcode == _MESSAGE:
            _add(data[start : start + length], keys)
        position = start + length


def _add(record: bytes, keys: set[Key]) -> None:
    if len(record) >= _HEAD.size:
        keys.add((_HEAD.unpack_from(record)[2], record[_HEAD.size :]))


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
