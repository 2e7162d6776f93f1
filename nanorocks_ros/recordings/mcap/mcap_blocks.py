"""The inside of an MCAP file: records, chunks, and blocks that are read in one go.

Records are cut out here by their length, checked against what there is, because a recording
that lost its power ends in the middle of one; the `mcap` library takes them apart.
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
# Names stand at the front of a chunk. What is damaged is decompressed piece by piece.
_NAMES_BYTES, _PIECE_BYTES, _CHECKSUM_BYTES = 1 << 21, 1 << 12, 4
# A flipped bit in a length must not ask for all memory; common writers stay below 16 MB.
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
"""What the `mcap` library and the decompressors raise over bytes that make no sense."""


class DamagedError(ValueError):
    """A stretch of a file that cannot be read."""


class StoredMessage(NamedTuple):
    """A message record: channel, log time in ns, content."""

    channel: int
    log_time_ns: int
    data: memoryview


class Catalogue:
    """Channels and schemas met so far, by their numbers.

    Attributes
    ----------
    channels : dict of int to mcap.records.Channel
    schemas : dict of int to mcap.records.Schema
    """

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}

    def note(self, opcode: int, content: memoryview) -> None:
        """Keep a record if it is a channel or a schema."""
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream_of(content))
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream_of(content))
            self.channels.setdefault(channel.id, channel)


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A stretch of whole records that is read in one go: a chunk, or messages outside chunks.

    Parameters
    ----------
    offset, length : int
        Of the records in the file, [bytes].
    start_ns, end_ns : int, [ns]
        No message in it is earlier or later.
    channels : frozenset of int, or None
        The channels that have messages in it; None when that is not known.
    indexed_bytes : int
        Length of the message indexes that follow it, [bytes].
    cut : bool
        A chunk at the end of a file cut short: what there is of it is used.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None
    indexed_bytes: int = 0
    cut: bool = False


def stream_of(content: memoryview | bytes) -> ReadDataStream:
    """The content of one record, for the `mcap` library; bounded by the record's length."""
    return ReadDataStream(BytesIO(content))


def walk(data: memoryview, *, cut: bool = False) -> Iterator[tuple[int, memoryview]]:
    """Opcode and content of each record.

    Parameters
    ----------
    data : memoryview
    cut : bool
        The last record may be incomplete; it is left out.

    Raises
    ------
    DamagedError
        When the lengths of the records do not add up.
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
            raise DamagedError('chunk of another size than declared')
        return zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    if chunk.compression == 'lz4':
        return bytes(lz4.frame.decompress(chunk.data))
    if chunk.compression:
        raise DamagedError(f'compression {chunk.compression!r} is not known')
    return chunk.data


def _decompressed_so_far(data: bytes, compression: str) -> bytes:
    """As much as can be decompressed, whether it breaks off or is damaged further on."""
    if not compression:
        return data
    work = (
        zstandard.ZstdDecompressor().decompressobj()
        if compression == 'zstd'
        else lz4.frame.LZ4FrameDecompressor()
    )
    found = bytearray()
    # The checksum by itself: where it is wrong, what comes before it is given all the same.
    places = [*range(0, len(data) - _CHECKSUM_BYTES, _PIECE_BYTES), len(data) - _CHECKSUM_BYTES]
    try:
        for start, end in pairwise([*places, len(data)]):
            found += work.decompress(data[max(0, start) : end])
    except (*UNREADABLE, EOFError):
        pass
    return bytes(found)


def _inside(content: memoryview) -> memoryview:
    chunk = Chunk.read(stream_of(content))
    data = _decompressed(chunk)
    if len(data) != chunk.uncompressed_size:
        raise DamagedError('chunk of another size than declared')
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise DamagedError('chunk with a wrong checksum')
    return memoryview(data)


def _message(content: memoryview) -> StoredMessage:
    channel, _, log_time_ns, _ = _MESSAGE.unpack_from(content)
    return StoredMessage(channel, log_time_ns, content[_MESSAGE.size :])


def _gather(
    data: memoryview, catalogue: Catalogue, found: list[StoredMessage], *, cut: bool
) -> None:
    for opcode, content in walk(data, cut=cut):
        if opcode == Opcode.MESSAGE:
            found.append(_message(content))
        elif opcode == Opcode.CHUNK:
            _gather(_inside(content), catalogue, found, cut=False)
        else:
            catalogue.note(opcode, content)


def load(stream: BinaryIO, block: Block, catalogue: Catalogue) -> list[StoredMessage]:
    """The messages of a block, all or none.

    Parameters
    ----------
    stream : binary file
    block : Block
    catalogue : Catalogue
        Gains the channels and schemas of the block.

    Returns
    -------
    list of StoredMessage
        In the order of the file.

    Raises
    ------
    DamagedError
        When the block is not what was written.
    """
    stream.seek(block.offset)
    raw = memoryview(stream.read(block.length))
    messages: list[StoredMessage] = []
    try:
        if block.cut:
            chunk = Chunk.read(stream_of(raw[RECORD.size :]))
            data = _decompressed_so_far(chunk.data, chunk.compression)
            _gather(memoryview(data), catalogue, messages, cut=True)
        else:
            _gather(raw, catalogue, messages, cut=False)
    except UNREADABLE as error:
        _gather_names(bytes(raw), catalogue)
        raise DamagedError(str(error)) from error
    return messages


def gather_names(stream: BinaryIO, start: int, end: int, catalogue: Catalogue) -> None:
    """Note the channels and schemas at the front of a damaged stretch, which others rely on.

    Parameters
    ----------
    stream : binary file
    start, end : int
        Of the stretch, [bytes].
    catalogue : Catalogue
    """
    stream.seek(start)
    _gather_names(stream.read(min(end - start, _NAMES_BYTES)), catalogue)


def _gather_names(raw: bytes, catalogue: Catalogue) -> None:
    for compression, magic in _FRAME_STARTS.items():
        place = raw.find(magic)
        if place < 0:
            continue
        data = _decompressed_so_far(raw[place : place + _NAMES_BYTES], compression)
        try:
            for opcode, content in walk(memoryview(data), cut=True):
                catalogue.note(opcode, content)
        except UNREADABLE:
            return


def indexed_messages(content: memoryview) -> int:
    """How many messages a message index lists."""
    _, length = _INDEX_OF_CHANNEL.unpack_from(content)
    return int(length) // _INDEX_ENTRY_BYTES


def indexed_after(stream: BinaryIO, block: Block) -> int:
    """How many messages the indexes that follow a block list; 0 when they cannot be read."""
    stream.seek(block.offset + block.length)
    raw = memoryview(stream.read(block.indexed_bytes))
    try:
        return sum(indexed_messages(c) for op, c in walk(raw) if op == Opcode.MESSAGE_INDEX)
    except UNREADABLE:
        return 0
