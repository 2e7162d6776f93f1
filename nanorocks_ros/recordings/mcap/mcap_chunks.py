"""Unpack the chunks of an MCAP file, within limits, and check their checksums.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

import struct
import zlib
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import lz4.frame
import zstandard
from mcap.exceptions import McapError

from nanorocks_ros.limits import CHUNK_BYTES, CHUNK_RATIO, Limit

COMPRESSIONS = (b'', b'zstd', b'lz4')
"""Names of the compressions of a chunk."""

FRAME_STARTS = {'zstd': b'\x28\xb5\x2f\xfd', 'lz4': b'\x04\x22\x4d\x18'}
"""First bytes of compressed data, by the name of the compression."""

CHUNK_HEAD = struct.Struct('<QQQII')
"""Times, size, checksum, and length of the name of the compression."""

_LENGTH = struct.Struct('<Q')
# Data is decompressed in pieces, of which none becomes large: zstd packs 128 KiB into 4 bytes.
# The checksum at the end is a piece of its own.
_SMALL_PIECE, _CHECKSUM_BYTES = 1 << 9, 4
# The longest head of zstd data, which states the unpacked size.
_ZSTD_HEAD_BYTES = 32
# The ratio is limited for large chunks only: zeros of a dark image are packed well.
_RATIO_FROM = 64 << 20

UNREADABLE = (
    McapError,
    struct.error,
    ValueError,
    OverflowError,
    RuntimeError,
    EOFError,
    zstandard.ZstdError,
    MemoryError,
)
"""Exceptions of the `mcap` library and the decompressors for damaged data."""


Unpacked: TypeAlias = 'bytes | bytearray'


class DamagedError(ValueError):
    """A part of a file cannot be read."""


class ChecksumError(DamagedError):
    """A chunk can be unpacked, but its checksum or size is wrong.

    Parameters
    ----------
    data : bytes or bytearray
        What it holds; single bits may be wrong.
    """

    def __init__(self, data: Unpacked) -> None:
        super().__init__('checksum of a chunk is wrong')
        self.data = data


class TooLargeError(DamagedError):
    """A part of a file is larger than a limit.

    Parameters
    ----------
    limit : Limit
    """

    def __init__(self, limit: Limit) -> None:
        super().__init__(
            f'{limit.quantity}: above the limit of {limit.value} {limit.unit} '
            f'({limit.variable} raises it)'
        )


class StoredChunk(NamedTuple):
    """Head and packed records of a chunk."""

    start_ns: int
    end_ns: int
    size: int
    checksum: int
    compression: str
    packed: memoryview


def stored_chunk(content: memoryview) -> StoredChunk:
    """Split the content of a chunk record.

    The packed records reach to the end of the content, whatever their length says: where the
    two differ, the caller has chosen the end.

    Raises
    ------
    DamagedError
        If it is too short.
    """
    try:
        start_ns, end_ns, size, checksum, length = CHUNK_HEAD.unpack_from(content)
        name = bytes(content[CHUNK_HEAD.size :][:length]).decode('utf-8', 'replace')
        begin = CHUNK_HEAD.size + length + _LENGTH.size
        if begin > len(content):
            raise DamagedError('head of a chunk is damaged')
        return StoredChunk(start_ns, end_ns, size, checksum, name, content[begin:])
    except struct.error as error:
        raise DamagedError('head of a chunk is damaged') from error


def unpacked(chunk: StoredChunk) -> Unpacked:
    """The records of a chunk.

    Raises
    ------
    ChecksumError
        If they can be unpacked, but differ from the checksum or the size in the head.
    DamagedError
        If they cannot be unpacked, or are larger than the limits allow; then with the setting.
    """
    data = _unpacked(chunk)
    if chunk.checksum:
        # The size has no checksum of its own: the content decides.
        if zlib.crc32(data) != chunk.checksum:
            raise ChecksumError(data)
    elif len(data) != chunk.size:
        raise ChecksumError(data)
    return data


def _unpacked(chunk: StoredChunk) -> Unpacked:
    if not chunk.compression:
        return bytes(chunk.packed)
    if chunk.compression not in FRAME_STARTS:
        raise DamagedError(f'unknown compression {chunk.compression!r}')
    if chunk.compression == 'zstd':
        return _zstd(chunk.packed)
    return _in_pieces(chunk.packed, chunk.compression)


def _decompressor(compression: str) -> Any:
    return (
        zstandard.ZstdDecompressor().decompressobj()
        if compression == 'zstd'
        else lz4.frame.LZ4FrameDecompressor()
    )


def _in_pieces(packed: memoryview, compression: str) -> bytearray:
    """Unpack piece by piece, so that a bomb is noticed before it fills the memory."""
    decompressor, content = _decompressor(compression), bytearray()
    for start in range(0, len(packed), _SMALL_PIECE):
        content += decompressor.decompress(bytes(packed[start : start + _SMALL_PIECE]))
        _check_size(len(content), len(packed))
        if decompressor.eof:
            return content
    raise DamagedError('compressed data of a chunk ends early')


def _zstd(packed: memoryview) -> Unpacked:
    stated = zstandard.get_frame_parameters(bytes(packed[:_ZSTD_HEAD_BYTES])).content_size
    if stated == zstandard.CONTENTSIZE_UNKNOWN:
        return _in_pieces(packed, 'zstd')
    _check_size(stated, len(packed))
    return zstandard.ZstdDecompressor().decompress(packed)


def _check_size(size: int, packed: int) -> None:
    if size > CHUNK_BYTES.value:
        raise TooLargeError(CHUNK_BYTES)
    if size > _RATIO_FROM and size > packed * CHUNK_RATIO.value:
        raise TooLargeError(CHUNK_RATIO)


def unpacked_prefix(data: bytes, compression: str, most: int | None = None) -> Unpacked:
    """Unpack truncated or damaged data as far as possible.

    Parameters
    ----------
    data : bytes
    compression : str
    most : int, optional, [bytes]
        No more than somewhat above this; by default the limit of a chunk.
    """
    most = CHUNK_BYTES.value if most is None else most
    if not compression:
        return data
    decompressor = _decompressor(compression)
    content = bytearray()
    # The checksum is a separate piece: if it is wrong, the data before it is still returned.
    last = len(data) - _CHECKSUM_BYTES
    starts = [*range(0, last, _SMALL_PIECE), last]
    try:
        for start, end in pairwise([*starts, len(data)]):
            content += decompressor.decompress(data[max(0, start) : end])
            if len(content) > most:
                break
    except UNREADABLE:
        pass
    return content
