"""Records, chunks and blocks of an MCAP file.

Records are split here by their lengths, which are checked against the size of the data, because a
recording that lost its power ends inside a record. The `mcap` library parses the records.

Tested by ``test/recordings/bag/test_find_bags.py``.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from mcap.opcode import Opcode

from nanorocks_ros.limits import CHUNK_BYTES, CHUNK_MESSAGES, RECORD_RATIO
from nanorocks_ros.recordings.mcap.mcap_catalogue import Catalogue
from nanorocks_ros.recordings.mcap.mcap_chunks import (
    FRAME_STARTS,
    UNREADABLE,
    ChecksumError,
    DamagedError,
    TooLargeError,
    Unpacked,
    stored_chunk,
    unpacked,
    unpacked_prefix,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

MAGIC = b'\x89MCAP0\r\n'
RECORD = struct.Struct('<BQ')
MESSAGE_HEAD = struct.Struct('<HIQQ')
_INDEX_OF_CHANNEL = struct.Struct('<HI')
_INDEX_ENTRY_BYTES = 16
# Channels and schemas are at the front of a chunk.
_CATALOGUE_BYTES = 1 << 21
_IN_CHUNKS = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
# So many records may be packed into any number of bytes.
_FEW_RECORDS = 1000


class StoredMessage(NamedTuple):
    """A message record.

    Parameters
    ----------
    channel : int
    log_time_ns : int, [ns]
    data : memoryview
        Content of the message.
    """

    channel: int
    log_time_ns: int
    data: memoryview


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Consecutive complete records that are read together: a chunk, or messages outside chunks.

    Parameters
    ----------
    offset, length : int
        Position of the records in the file, [bytes].
    start_ns, end_ns : int, [ns]
        Smallest and largest log time of its messages.
    channels : frozenset of int, or None
        Channels of its messages; None if they are not known.
    indexed_bytes : int
        Length of the message indexes behind it, [bytes].
    cut : bool
        Whether it is an incomplete chunk at the end of a truncated file; its readable part is
        used.
    chunk : bool
        Whether it is one chunk; otherwise records outside chunks.
    indexed : bool
        Whether the index of the file says so; then its head must say the same.
    unverified : bool
        Whether its content is used although it differs from its checksum.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None
    indexed_bytes: int = 0
    cut: bool = False
    chunk: bool = False
    indexed: bool = False
    unverified: bool = False


def iterate_records(data: memoryview, *, cut: bool = False) -> Iterator[tuple[int, memoryview]]:
    """Iterate over the opcode and content of each record.

    Parameters
    ----------
    data : memoryview
    cut : bool
        The last record may be incomplete; it is skipped.

    Raises
    ------
    DamagedError
        If the lengths of the records do not add up to the length of the data.
    """
    position = 0
    while len(data) - position >= RECORD.size:
        opcode, length = RECORD.unpack_from(data, position)
        end = position + RECORD.size + length
        if end > len(data):
            break
        yield opcode, data[position + RECORD.size : end]
        position = end
    if position < len(data) and not cut:
        raise DamagedError('records do not add up')


def _message(content: memoryview) -> StoredMessage:
    channel, _, log_time_ns, _ = MESSAGE_HEAD.unpack_from(content)
    return StoredMessage(channel, log_time_ns, content[MESSAGE_HEAD.size :])


def _bounded_records(
    data: memoryview, packed: int, *, cut: bool
) -> Iterator[tuple[int, memoryview]]:
    """As `iterate_records`, while there are no more than a chunk of so many bytes may hold."""
    most, ratio = CHUNK_MESSAGES.value, max(_FEW_RECORDS, packed * RECORD_RATIO.value)
    for number, record in enumerate(iterate_records(data, cut=cut)):
        if number >= ratio:
            raise TooLargeError(RECORD_RATIO)
        if number >= most:
            raise TooLargeError(CHUNK_MESSAGES)
        yield record


def _collect(
    records: Iterator[tuple[int, memoryview]],
    catalogue: Catalogue,
    messages: list[StoredMessage],
) -> None:
    """Append the messages to a list, and add channels and schemas to a catalogue."""
    for opcode, content in records:
        if opcode == Opcode.MESSAGE:
            messages.append(_message(content))
        elif opcode in _IN_CHUNKS:
            catalogue.add(opcode, content)
        else:
            raise DamagedError(f'a record of kind {opcode} where a message must stand')


def _collect_readable(
    records: Iterator[tuple[int, memoryview]],
    catalogue: Catalogue,
    messages: list[StoredMessage],
) -> None:
    """As `_collect`, without records that cannot be read or are of another kind."""
    for opcode, content in records:
        with suppress(*UNREADABLE):
            if opcode == Opcode.MESSAGE:
                messages.append(_message(content))
            else:
                catalogue.add(opcode, content)


def load(stream: BinaryIO, block: Block, catalogue: Catalogue) -> list[StoredMessage]:
    """Load all messages of a block.

    Parameters
    ----------
    stream : binary file
    block : Block
    catalogue : Catalogue
        The channels and schemas of the block are added to it.

    Returns
    -------
    list of StoredMessage
        In the order of the file.

    Raises
    ------
    ChecksumError
        If only its checksum is wrong.
    TooLargeError
        If it is larger than a limit.
    DamagedError
        If any part of the block is damaged.
    """
    if block.length > CHUNK_BYTES.value:
        raise TooLargeError(CHUNK_BYTES)
    stream.seek(block.offset)
    raw = memoryview(stream.read(block.length))
    messages: list[StoredMessage] = []
    try:
        if block.chunk:
            data = memoryview(_records_of_chunk(raw, block))
            records = _bounded_records(data, len(raw), cut=block.cut or block.unverified)
            collect = _collect_readable if block.unverified else _collect
            collect(records, catalogue, messages)
        else:
            _collect(iterate_records(raw), catalogue, messages)
    except (ChecksumError, TooLargeError):
        raise
    except UNREADABLE as error:
        _recover_catalogue(bytes(raw), catalogue)
        raise DamagedError(str(error)) from error
    if block.indexed and not _are_in_range(messages, block):
        raise DamagedError('the index leads to another chunk')
    return messages


def _records_of_chunk(raw: memoryview, block: Block) -> Unpacked:
    if block.indexed:
        opcode, length = RECORD.unpack_from(raw)
        if opcode != Opcode.CHUNK or RECORD.size + length != block.length:
            raise DamagedError('the index leads to no chunk')
    chunk = stored_chunk(raw[RECORD.size :])
    if block.cut:
        return unpacked_prefix(bytes(chunk.packed), chunk.compression)
    try:
        return unpacked(chunk)
    except ChecksumError as error:
        if block.unverified:
            return error.data
        raise


def _are_in_range(messages: list[StoredMessage], block: Block) -> bool:
    return all(block.start_ns <= message.log_time_ns <= block.end_ns for message in messages)


def recover_catalogue(stream: BinaryIO, start: int, end: int, catalogue: Catalogue) -> None:
    """Recover channels and schemas from a damaged part of a file; later chunks may need them.

    Parameters
    ----------
    stream : binary file
    start, end : int
        Offsets of the damaged part, [bytes].
    catalogue : Catalogue
        The channels and schemas are added to it.
    """
    stream.seek(start)
    _recover_catalogue(stream.read(min(end - start, _CATALOGUE_BYTES)), catalogue)


def _recover_catalogue(raw: bytes, catalogue: Catalogue) -> None:
    for compression, magic in FRAME_STARTS.items():
        offset = raw.find(magic)
        if offset < 0:
            continue
        packed = raw[offset : offset + _CATALOGUE_BYTES]
        data = unpacked_prefix(packed, compression, _CATALOGUE_BYTES)
        try:
            for opcode, content in iterate_records(memoryview(data), cut=True):
                catalogue.add(opcode, content)
        except UNREADABLE:
            return


def indexed_count_at(stream: BinaryIO, start: int, end: int) -> int:
    """Number of messages that the message index at these offsets lists."""
    stream.seek(start + RECORD.size)
    try:
        _, length = _INDEX_OF_CHANNEL.unpack(stream.read(_INDEX_OF_CHANNEL.size))
    except struct.error:
        return 0
    return min(int(length), end - start) // _INDEX_ENTRY_BYTES


def indexed_count_after(stream: BinaryIO, block: Block) -> int | None:
    """Number of messages in the message indexes behind a block; None if they cannot be read."""
    position = block.offset + block.length
    end, count = position + block.indexed_bytes, 0
    while position < end:
        stream.seek(position)
        raw = stream.read(RECORD.size)
        if len(raw) < RECORD.size:
            return None
        opcode, length = RECORD.unpack(raw)
        if opcode != Opcode.MESSAGE_INDEX or position + RECORD.size + length > end:
            return None
        count += indexed_count_at(stream, position, position + RECORD.size + length)
        position += RECORD.size + length
    return count
