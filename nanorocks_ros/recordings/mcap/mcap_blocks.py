"""Records, chunks and blocks of an MCAP file.

Records are split here by their lengths, which are checked against the size of the data, because a
recording that lost its power ends inside a record. The `mcap` library parses the records.

Tested by ``test/recordings/bag/test_find_bags.py``.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

MAGIC = b'\x89MCAP0\r\n'
RECORD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<HIQQ')
_INDEX_OF_CHANNEL = struct.Struct('<HI')
_INDEX_ENTRY_BYTES = 16
_FRAME_STARTS = {'zstd': b'\x28\xb5\x2f\xfd', 'lz4': b'\x04\x22\x4d\x18'}
# Channels and schemas are at the front of a chunk. Damaged data is decompressed in pieces.
_CATALOGUE_BYTES, _PIECE_BYTES, _CHECKSUM_BYTES = 1 << 21, 1 << 12, 4
# Largest size of a decompressed chunk, [bytes], in case a bit of the size is flipped; common
# writers stay below 16 MB.
_CHUNK_LIMIT = 2**31

UNREADABLE = (
    McapError,
    struct.error,
    ValueError,
    OverflowError,
    RuntimeError,
    zstandard.ZstdError,
    MemoryError,
)
"""Exceptions of the `mcap` library and the decompressors for damaged data."""


class DamagedError(ValueError):
    """A part of a file cannot be read."""


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


class Catalogue:
    """Channels and schemas read so far, by their ids.

    Attributes
    ----------
    channels : dict of int to mcap.records.Channel
    schemas : dict of int to mcap.records.Schema
    """

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}

    def add(self, opcode: int, content: memoryview) -> None:
        """Add a record if it is a channel or a schema."""
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(data_stream(content))
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(data_stream(content))
            self.channels.setdefault(channel.id, channel)


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
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None
    indexed_bytes: int = 0
    cut: bool = False


def data_stream(content: memoryview | bytes) -> ReadDataStream:
    """Content of one record as a stream for the `mcap` library."""
    return ReadDataStream(BytesIO(content))


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


def _decompressed(chunk: Chunk) -> bytes:
    if chunk.uncompressed_size > _CHUNK_LIMIT:
        raise DamagedError(f'chunk of {chunk.uncompressed_size} bytes')
    if chunk.compression == 'zstd':
        size = zstandard.get_frame_parameters(chunk.data).content_size
        if size not in (chunk.uncompressed_size, zstandard.CONTENTSIZE_UNKNOWN):
            raise DamagedError('size of a chunk differs from its header')
        return zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    if chunk.compression == 'lz4':
        return bytes(lz4.frame.decompress(chunk.data))
    if chunk.compression:
        raise DamagedError(f'unknown compression {chunk.compression!r}')
    return chunk.data


def _decompressed_prefix(data: bytes, compression: str) -> bytes:
    """Decompress truncated or damaged data as far as possible."""
    if not compression:
        return data
    decompressor = (
        zstandard.ZstdDecompressor().decompressobj()
        if compression == 'zstd'
        else lz4.frame.LZ4FrameDecompressor()
    )
    content = bytearray()
    # The checksum is a separate piece: if it is wrong, the data before it is still returned.
    starts = [*range(0, len(data) - _CHECKSUM_BYTES, _PIECE_BYTES), len(data) - _CHECKSUM_BYTES]
    try:
        for start, end in pairwise([*starts, len(data)]):
            content += decompressor.decompress(data[max(0, start) : end])
    except (*UNREADABLE, EOFError):
        pass
    return bytes(content)


def _chunk_records(content: memoryview) -> memoryview:
    chunk = Chunk.read(data_stream(content))
    data = _decompressed(chunk)
    if len(data) != chunk.uncompressed_size:
        raise DamagedError('size of a chunk differs from its header')
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise DamagedError('checksum of a chunk is wrong')
    return memoryview(data)


def _message(content: memoryview) -> StoredMessage:
    channel, _, log_time_ns, _ = _MESSAGE.unpack_from(content)
    return StoredMessage(channel, log_time_ns, content[_MESSAGE.size :])


def _collect(
    data: memoryview, catalogue: Catalogue, messages: list[StoredMessage], *, cut: bool
) -> None:
    """Append the messages in the data to a list, and add channels and schemas to a catalogue."""
    for opcode, content in iterate_records(data, cut=cut):
        if opcode == Opcode.MESSAGE:
            messages.append(_message(content))
        elif opcode == Opcode.CHUNK:
            _collect(_chunk_records(content), catalogue, messages, cut=False)
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
    DamagedError
        If any part of the block is damaged.
    """
    stream.seek(block.offset)
    raw = memoryview(stream.read(block.length))
    messages: list[StoredMessage] = []
    try:
        if block.cut:
            chunk = Chunk.read(data_stream(raw[RECORD.size :]))
            data = _decompressed_prefix(chunk.data, chunk.compression)
            _collect(memoryview(data), catalogue, messages, cut=True)
        else:
            _collect(raw, catalogue, messages, cut=False)
    except UNREADABLE as error:
        _recover_catalogue(bytes(raw), catalogue)
        raise DamagedError(str(error)) from error
    return messages


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
    for compression, magic in _FRAME_STARTS.items():
        offset = raw.find(magic)
        if offset < 0:
            continue
        data = _decompressed_prefix(raw[offset : offset + _CATALOGUE_BYTES], compression)
        try:
            for opcode, content in iterate_records(memoryview(data), cut=True):
                catalogue.add(opcode, content)
        except UNREADABLE:
            return


def indexed_messages(content: memoryview) -> int:
    """Number of messages that a message index lists."""
    _, length = _INDEX_OF_CHANNEL.unpack_from(content)
    return int(length) // _INDEX_ENTRY_BYTES


def indexed_count_after(stream: BinaryIO, block: Block) -> int:
    """Number of messages in the message indexes behind a block; 0 if they cannot be read."""
    stream.seek(block.offset + block.length)
    raw = memoryview(stream.read(block.indexed_bytes))
    try:
        return sum(
            indexed_messages(c) for op, c in iterate_records(raw) if op == Opcode.MESSAGE_INDEX
        )
    except UNREADABLE:
        return 0
