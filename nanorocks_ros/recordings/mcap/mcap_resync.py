"""Find where sound records of an MCAP file begin again behind damage.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from nanorocks_ros.recordings.mcap.mcap_blocks import MAGIC
from nanorocks_ros.recordings.mcap.mcap_heads import FIRST_PRIVATE, Head, is_sound, read_head

if TYPE_CHECKING:
    from typing import BinaryIO

_FIRST_WINDOW_BYTES, _WINDOW_BYTES, _HEAD_BYTES = 1 << 12, 1 << 20, 9
# Start of a record that is shorter than 4 GB; looked ahead, so that candidates may overlap.
# Starts of messages, channels and schemas are looked for only where they stand outside of chunks:
# a damaged chunk holds such bytes, too.
_ANY_START = re.compile(rb'[\x02-\x0f](?=[\s\S]{4}\x00{4})')
_CHUNK_START = re.compile(rb'[\x02\x06-\x0f](?=[\s\S]{4}\x00{4})')
# Sound records needed in a row, the first included; less at the end of the file.
_IN_A_ROW = 3
# Length of records that may be cut at the end of a file, [bytes].
_LONGEST = 1 << 28
# Such records have fields that hardly any other bytes fill by chance.
_TELLING = frozenset({Opcode.CHUNK, Opcode.CHUNK_INDEX, Opcode.STATISTICS, Opcode.MESSAGE_INDEX})


def is_record(stream: BinaryIO, head: Head, size: int) -> bool:
    """Whether a record is of a known kind and sound."""
    return head.opcode < FIRST_PRIVATE and is_sound(stream, head, size)


def records_follow(
    stream: BinaryIO, position: int, size: int, count: int = 1, boundary: int = 0
) -> bool:
    """Whether sound records, or the end of the file, follow from this offset.

    The last record may be cut short.

    Parameters
    ----------
    stream : binary file
    position, size : int, [bytes]
    count : int
        Number of records.
    boundary : int, [bytes]
        Where a damaged chunk ends that holds the records; counts as the end of the file.
    """
    for _ in range(count):
        if position == boundary or _is_end(stream, position, size):
            return True
        head = read_head(stream, position, size)
        # Fewer bytes than a head are the rest of a file that was cut short.
        if head is None:
            return position <= size
        if not is_record(stream, head, size):
            return _is_cut(head, size)
        position = head.end
    return True


def _is_cut(head: Head, size: int) -> bool:
    """Whether a record seems to be the last of a file that was cut short."""
    return head.end > size and 0 < head.opcode <= Opcode.DATA_END and head.end < size + _LONGEST


def _is_end(stream: BinaryIO, position: int, size: int) -> bool:
    if position == size:
        return True
    if size - position != len(MAGIC):
        return False
    stream.seek(position)
    return stream.read() == MAGIC


def next_record(
    stream: BinaryIO, position: int, size: int, *, messages: bool, boundary: int = 0
) -> int | None:
    """Offset of the next sound records; None if there are none.

    Parameters
    ----------
    stream : binary file
    position, size : int, [bytes]
    messages : bool
        Look for messages, channels and schemas, too.
    boundary : int, [bytes]
        See `records_follow`.

    Returns
    -------
    int or None, [bytes]
    """
    starts = _ANY_START if messages else _CHUNK_START
    # Most damage is small: reading far ahead each time would make many damages slow.
    window = _FIRST_WINDOW_BYTES
    while position < size:
        stream.seek(position)
        data = stream.read(window)
        window = min(4 * window, _WINDOW_BYTES)
        for match in starts.finditer(data):
            if _begins_records(stream, position + match.start(), size, boundary):
                return position + match.start()
        if len(data) <= _HEAD_BYTES:
            break
        position += len(data) - _HEAD_BYTES + 1
    return None


def _begins_records(stream: BinaryIO, position: int, size: int, boundary: int) -> bool:
    head = read_head(stream, position, size)
    if head is None or not is_record(stream, head, size):
        return False
    if head.opcode in _TELLING:
        return True
    return records_follow(stream, head.end, size, _IN_A_ROW - 1, boundary)
