"""Build the index of an MCAP file that has none, by scanning the file.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from nanorocks_ros.recordings.mcap.mcap_blocks import (
    MAGIC,
    RECORD,
    UNREADABLE,
    Block,
    DamagedError,
    indexed_messages,
    iterate_records,
    load,
    recover_catalogue,
)
from nanorocks_ros.recordings.mcap.mcap_index import McapIndex

if TYPE_CHECKING:
    from typing import BinaryIO

# Messages outside chunks are joined to runs of about this size.
_RUN_BYTES = 1 << 20
_LAST_OPCODE = 0x0F
_FIRST_PRIVATE_OPCODE = 0x80
# Start of a chunk or message index that is shorter than 4 GB. Starts of messages are searched
# only in files with messages outside of chunks; compressed data may contain such bytes by chance.
_CHUNK_START = re.compile(rb'[\x06\x07][\s\S]{4}\x00{4}')
_MESSAGE_START = re.compile(rb'[\x05\x06\x07][\s\S]{4}\x00{4}')
# Consecutive plausible records needed to continue behind a damage.
_IN_A_ROW = 3
# Largest part of the summary section that is read.
_SUMMARY_BYTES = 1 << 26
# Header of a chunk: times, size, checksum, and length of the name of its compression.
_CHUNK_HEAD = struct.Struct('<QQQII')
_LONGEST_NAME = 16
# Records that end the data section.
_END_OF_DATA = (Opcode.DATA_END, Opcode.FOOTER)


class _Scanner:
    """Scan a file from its beginning, as far as it can be read."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream = stream
        self._size = size
        self._run: tuple[int, int] | None = None
        self._damaged: int | None = None
        # Messages that were read and that the message indexes have not counted yet.
        self._uncounted = 0
        # Whether the file has messages outside of chunks.
        self._unchunked = False
        self.index = McapIndex()

    def run(self) -> None:
        position = len(MAGIC)
        while position + RECORD.size <= self._size:
            self._stream.seek(position)
            opcode, length = RECORD.unpack(self._stream.read(RECORD.size))
            end = position + RECORD.size + length
            if not _plausible(opcode) or end > self._size:
                next_record = self._next_record(position, opcode, length)
                if next_record is None:
                    break
                self._end_run()
                self._damaged = position
                self.index.lost[position] = 0
                recover_catalogue(self._stream, position, next_record, self.index.catalogue)
                position = next_record
                continue
            if opcode in _END_OF_DATA:
                self._end_run()
                self.index.ended = self._has_footer()
                self._read_summary(end)
                return
            self._handle_record(opcode, position, end)
            position = end
        self._end_run()
        self._note_truncation(min(position, self._size))

    def _next_record(self, position: int, opcode: int, length: int) -> int | None:
        """Offset of the next intact record behind a damaged one; None if there is none."""
        if opcode == Opcode.CHUNK and self._is_truncated_chunk(position, length):
            return None
        starts = _MESSAGE_START if self._unchunked and opcode != Opcode.CHUNK else _CHUNK_START
        window = position + 1
        while window < self._size:
            self._stream.seek(window)
            data = self._stream.read(_RUN_BYTES)
            for match in starts.finditer(data):
                if self._records_follow(window + match.start()):
                    return window + match.start()
            window += max(1, len(data) - RECORD.size)
        return None

    def _is_truncated_chunk(self, position: int, length: int) -> bool:
        """Whether the lengths in a chunk header agree, so that the file ends inside the chunk."""
        self._stream.seek(position + RECORD.size)
        head = self._stream.read(_CHUNK_HEAD.size + _LONGEST_NAME)
        if len(head) < _CHUNK_HEAD.size + _LONGEST_NAME:
            return True
        name = int(_CHUNK_HEAD.unpack_from(head)[-1])
        if name > _LONGEST_NAME - 8:
            return False
        (records,) = struct.unpack_from('<Q', head, _CHUNK_HEAD.size + name)
        return bool(_CHUNK_HEAD.size + name + 8 + records == length)

    def _records_follow(self, position: int) -> bool:
        """Whether several plausible records follow from this offset."""
        for _ in range(_IN_A_ROW):
            if position + RECORD.size > self._size:
                return False
            self._stream.seek(position)
            opcode, length = RECORD.unpack(self._stream.read(RECORD.size))
            position += RECORD.size + length
            if not 0 < opcode <= _LAST_OPCODE or position > self._size:
                return False
        return True

    def _has_footer(self) -> bool:
        self._stream.seek(self._size - len(MAGIC))
        return self._stream.read() == MAGIC

    def _read_summary(self, position: int) -> None:
        """Read the copies of channels and schemas at the end; the first ones may be damaged."""
        self._stream.seek(position)
        try:
            for opcode, content in iterate_records(
                memoryview(self._stream.read(_SUMMARY_BYTES)), cut=True
            ):
                self.index.catalogue.add(opcode, content)
        except UNREADABLE:
            return

    def _handle_record(self, opcode: int, position: int, end: int) -> None:
        if opcode == Opcode.MESSAGE_INDEX:
            self._count_lost(position, end)
            return
        self._unchunked = self._unchunked or opcode == Opcode.MESSAGE
        if opcode in (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
            start = self._run[0] if self._run else position
            self._run = (start, end)
            if end - start >= _RUN_BYTES:
                self._end_run()
            return
        self._end_run()
        if opcode == Opcode.CHUNK:
            self._add_block(position, end)

    def _end_run(self) -> None:
        if self._run is not None:
            run, self._run = self._run, None
            self._add_block(*run)

    def _add_block(self, start: int, end: int, *, cut: bool = False) -> None:
        unread = Block(
            offset=start, length=end - start, start_ns=0, end_ns=0, channels=None, cut=cut
        )
        try:
            messages = load(self._stream, unread, self.index.catalogue)
        except DamagedError:
            if not cut:
                self._damaged, self._uncounted = start, 0
                self.index.lost[start] = 0
            return
        self._uncounted = len(messages)
        self._damaged = None
        messages = self.index.with_valid_times(start, messages)
        if not messages:
            return
        self.index.count(messages)
        block = Block(
            offset=start,
            length=end - start,
            start_ns=min(message.log_time_ns for message in messages),
            end_ns=max(message.log_time_ns for message in messages),
            channels=frozenset(message.channel for message in messages),
            cut=cut,
        )
        self.index.blocks.append(block)

    def _count_lost(self, position: int, end: int) -> None:
        if self._damaged is None:
            return
        self._stream.seek(position + RECORD.size)
        content = memoryview(self._stream.read(end - position - RECORD.size))
        try:
            count = indexed_messages(content)
        except UNREADABLE:
            return
        self.index.lost[self._damaged] += max(0, count - self._uncounted)
        self._uncounted = max(0, self._uncounted - count)

    def _note_truncation(self, position: int) -> None:
        self.index.bytes_unread = self._size - position
        if position + RECORD.size > self._size:
            return
        self._stream.seek(position)
        if self._stream.read(1)[0] == Opcode.CHUNK:
            self._add_block(position, self._size, cut=True)


def _plausible(opcode: int) -> bool:
    return 0 < opcode <= _LAST_OPCODE or opcode >= _FIRST_PRIVATE_OPCODE


def scan(stream: BinaryIO, size: int) -> McapIndex:
    """Build an index by scanning the file, as far as it can be read.

    Parameters
    ----------
    stream : binary file
    size : int, [bytes]

    Returns
    -------
    McapIndex
    """
    scanner = _Scanner(stream, size)
    scanner.run()
    return scanner.index
