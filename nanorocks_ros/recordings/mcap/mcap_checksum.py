"""Checksums of an MCAP file: that of its index, which rosbags leaves out, and that of its data.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

from nanorocks_ros.recordings.mcap.mcap_blocks import MAGIC, RECORD

if TYPE_CHECKING:
    from pathlib import Path
    from typing import BinaryIO

_CHECKSUM = struct.Struct('<I')
_START = struct.Struct('<Q')
# Where the footer and its checksum begin, from the end of the file.
_FOOTER_BYTES = RECORD.size + 2 * _START.size + _CHECKSUM.size + len(MAGIC)
_CHECKSUM_BYTES = _CHECKSUM.size + len(MAGIC)
_BLOCK = 1 << 20


def add_summary_checksum(path: Path) -> None:
    """Write the checksum of the summary section into the footer of a finished file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OSError
        If it cannot be written.
    """
    with path.open('rb+') as stream:
        end = stream.seek(0, 2) - _CHECKSUM_BYTES
        stream.seek(end + _CHECKSUM_BYTES - _FOOTER_BYTES + RECORD.size)
        (start,) = _START.unpack(stream.read(_START.size))
        stream.seek(start)
        checksum, left = 0, end - start
        while left > 0:
            block = stream.read(min(left, _BLOCK))
            checksum = zlib.crc32(block, checksum)
            left -= len(block)
        stream.seek(end)
        stream.write(_CHECKSUM.pack(checksum))


def is_data_intact(stream: BinaryIO, data_end: int) -> bool:
    """Whether the data section has the checksum in the record behind it, if there is one.

    Parameters
    ----------
    stream : binary file
    data_end : int, [bytes]
        Offset of that record.
    """
    stream.seek(data_end + RECORD.size)
    (stated,) = _CHECKSUM.unpack(stream.read(_CHECKSUM.size))
    if not stated:
        return True
    stream.seek(0)
    checksum, left = 0, data_end
    while left > 0 and (block := stream.read(min(left, _BLOCK))):
        checksum = zlib.crc32(block, checksum)
        left -= len(block)
    return checksum == int(stated)
