"""Whether bytes are the head of an MCAP record: its fields must fill its length.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from mcap.opcode import Opcode

from nanorocks_ros.recordings.mcap.mcap_blocks import MESSAGE_HEAD, RECORD
from nanorocks_ros.recordings.mcap.mcap_chunks import CHUNK_HEAD, COMPRESSIONS

if TYPE_CHECKING:
    from typing import BinaryIO

# Fields of each record: numbers, s: text, map or array behind 32 bits of length, L: bytes behind
# 64 bits of length, *: any bytes.
_FIELDS: dict[int, str] = {
    Opcode.HEADER: 'ss',
    Opcode.FOOTER: 'QQI',
    Opcode.SCHEMA: 'Hsss',
    Opcode.CHANNEL: 'HHsss',
    Opcode.MESSAGE: 'HIQQ*',
    Opcode.CHUNK: 'QQQIsL',
    Opcode.MESSAGE_INDEX: 'Hs',
    Opcode.CHUNK_INDEX: 'QQQQsQsQQ',
    Opcode.ATTACHMENT: 'QQssLI',
    Opcode.ATTACHMENT_INDEX: 'QQQQQss',
    Opcode.STATISTICS: 'QHIIIIQQs',
    Opcode.METADATA: 'ss',
    Opcode.METADATA_INDEX: 'QQs',
    Opcode.SUMMARY_OFFSET: 'BQQ',
    Opcode.DATA_END: 'I',
}
_BYTES = {'B': 1, 'H': 2, 'I': 4, 'Q': 8}
_LENGTHS = {'s': struct.Struct('<I'), 'L': struct.Struct('<Q')}
_RECORDS = struct.Struct('<Q')
_LONGEST_NAME = max(map(len, COMPRESSIONS))
FIRST_PRIVATE = 0x80
"""First opcode that the format leaves to applications."""


class Head(NamedTuple):
    """Opcode and extent of a record in a file, [bytes]."""

    opcode: int
    start: int
    end: int


def read_head(stream: BinaryIO, position: int, size: int) -> Head | None:
    """Head of the record at an offset; None at the end of the file."""
    if position + RECORD.size > size:
        return None
    stream.seek(position)
    opcode, length = RECORD.unpack(stream.read(RECORD.size))
    return Head(opcode, position, position + RECORD.size + length)


def is_sound(stream: BinaryIO, head: Head, size: int) -> bool:
    """Whether the fields of a record fill its length, and the file holds all of it.

    Parameters
    ----------
    stream : binary file
    head : Head
    size : int, [bytes]
        Of the file.
    """
    if head.end > size:
        return False
    if head.opcode == Opcode.MESSAGE:
        return head.end - head.start >= RECORD.size + MESSAGE_HEAD.size
    fields = _FIELDS.get(head.opcode)
    if fields is None:
        return False
    position = head.start + RECORD.size
    for field in fields:
        if field in _BYTES:
            position += _BYTES[field]
            continue
        number = _LENGTHS[field]
        if position + number.size > head.end:
            return False
        stream.seek(position)
        position += number.size + int(number.unpack(stream.read(number.size))[0])
    return position == head.end


class ChunkExtent(NamedTuple):
    """Where the records of a chunk begin and where it may end.

    Parameters
    ----------
    content : int, [bytes]
        Offset of its records.
    compressed : bool
    ends : tuple of int, [bytes]
        By its own lengths and by that of its record; one offset if both agree.
    """

    content: int
    compressed: bool
    ends: tuple[int, ...]


def chunk_extent(stream: BinaryIO, head: Head) -> ChunkExtent | None:
    """The extent of a chunk at this record, whatever its opcode; None if it is no chunk."""
    stream.seek(head.start + RECORD.size)
    raw = stream.read(CHUNK_HEAD.size + _LONGEST_NAME + _RECORDS.size)
    if len(raw) < CHUNK_HEAD.size + _RECORDS.size:
        return None
    length = int(CHUNK_HEAD.unpack_from(raw)[-1])
    if length > _LONGEST_NAME or raw[CHUNK_HEAD.size :][:length] not in COMPRESSIONS:
        return None
    fixed = CHUNK_HEAD.size + length
    if fixed + _RECORDS.size > len(raw):
        return None
    content = head.start + RECORD.size + fixed + _RECORDS.size
    end = content + int(_RECORDS.unpack_from(raw, fixed)[0])
    if end == head.end:
        return ChunkExtent(content, length > 0, (end,))
    if head.opcode != Opcode.CHUNK:
        return None
    return ChunkExtent(content, length > 0, (end, head.end))
