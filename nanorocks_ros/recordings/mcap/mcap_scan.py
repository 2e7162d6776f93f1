"""Where the messages of an MCAP file without an end lie: found by going through the file."""

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
    gather_names,
    indexed_messages,
    load,
    walk,
)
from nanorocks_ros.recordings.mcap.mcap_index import McapIndex

if TYPE_CHECKING:
    from typing import BinaryIO

# Messages outside chunks are read in runs of about this many bytes.
_RUN_BYTES = 1 << 20
_LAST_OPCODE = 0x0F
_FIRST_PRIVATE_OPCODE = 0x80
# Where chunks and indexes of messages begin that are shorter than 4 GB; messages only in files
# that have them outside of chunks: inside, compression may have put bytes of its own into them.
_CHUNK_START = re.compile(rb'[\x06\x07][\s\S]{4}\x00{4}')
_MESSAGE_START = re.compile(rb'[\x05\x06\x07][\s\S]{4}\x00{4}')
_IN_A_ROW = 3
# No more is read of what follows the data.
_SUMMARY_BYTES = 1 << 26
# Times, size and checksum in the head of a chunk, and the length of the name of its compression.
_CHUNK_HEAD = struct.Struct('<QQQII')
_LONGEST_NAME = 16
# What may stand at the top of a file besides chunks and messages, and is not needed here.
_END_OF_DATA = (Opcode.DATA_END, Opcode.FOOTER)


class _Scan:
    """Goes through a file from the front, as far as it can be read."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream = stream
        self._size = size
        self._run: tuple[int, int] | None = None
        self._damaged: int | None = None
        # Messages read that the indexes behind them have not counted yet.
        self._uncounted = 0
        # Messages were met outside of chunks.
        self._loose = False
        self.index = McapIndex()

    def go(self) -> None:
        position = len(MAGIC)
        while position + RECORD.size <= self._size:
            self._stream.seek(position)
            opcode, length = RECORD.unpack(self._stream.read(RECORD.size))
            end = position + RECORD.size + length
            if not _plausible(opcode) or end > self._size:
                resumed = self._resumed(position, opcode, length)
                if resumed is None:
                    break
                self._end_run()
                self._damaged = position
                self.index.lost[position] = 0
                gather_names(self._stream, position, resumed, self.index.catalogue)
                position = resumed
                continue
            if opcode in _END_OF_DATA:
                self._end_run()
                self.index.ended = self._has_footer()
                self._note_summary(end)
                return
            self._record(opcode, position, end)
            position = end
        self._end_run()
        self._end_early(min(position, self._size))

    def _resumed(self, position: int, opcode: int, length: int) -> int | None:
        """Where records go on behind one whose head is damaged; None where none do."""
        if opcode == Opcode.CHUNK and self._is_cut(position, length):
            return None
        starts = _MESSAGE_START if self._loose and opcode != Opcode.CHUNK else _CHUNK_START
        window = position + 1
        while window < self._size:
            self._stream.seek(window)
            data = self._stream.read(_RUN_BYTES)
            for found in starts.finditer(data):
                if self._goes_on(window + found.start()):
                    return window + found.start()
            window += max(1, len(data) - RECORD.size)
        return None

    def _is_cut(self, position: int, length: int) -> bool:
        """Whether the lengths in a chunk agree: then the file ends in it."""
        self._stream.seek(position + RECORD.size)
        head = self._stream.read(_CHUNK_HEAD.size + _LONGEST_NAME)
        if len(head) < _CHUNK_HEAD.size + _LONGEST_NAME:
            return True
        name = int(_CHUNK_HEAD.unpack_from(head)[-1])
        if name > _LONGEST_NAME - 8:
            return False
        (records,) = struct.unpack_from('<Q', head, _CHUNK_HEAD.size + name)
        return bool(_CHUNK_HEAD.size + name + 8 + records == length)

    def _goes_on(self, position: int) -> bool:
        """Whether records follow one another from here."""
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

    def _note_summary(self, position: int) -> None:
        """Names come again at the end: where they stood at first may be damaged."""
        self._stream.seek(position)
        try:
            for opcode, content in walk(memoryview(self._stream.read(_SUMMARY_BYTES)), cut=True):
                self.index.catalogue.note(opcode, content)
        except UNREADABLE:
            return

    def _record(self, opcode: int, position: int, end: int) -> None:
        if opcode == Opcode.MESSAGE_INDEX:
            self._count_lost(position, end)
            return
        self._loose = self._loose or opcode == Opcode.MESSAGE
        if opcode in (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
            start = self._run[0] if self._run else position
            self._run = (start, end)
            if end - start >= _RUN_BYTES:
                self._end_run()
            return
        self._end_run()
        if opcode == Opcode.CHUNK:
            self._block(position, end)

    def _end_run(self) -> None:
        if self._run is not None:
            run, self._run = self._run, None
            self._block(*run)

    def _block(self, start: int, end: int, *, cut: bool = False) -> None:
        place = Block(
            offset=start, length=end - start, start_ns=0, end_ns=0, channels=None, cut=cut
        )
        try:
            messages = load(self._stream, place, self.index.catalogue)
        except DamagedError:
            if not cut:
                self._damaged, self._uncounted = start, 0
                self.index.lost[start] = 0
            return
        self._uncounted = len(messages)
        self._damaged = None
        messages = self.index.timely(start, messages)
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

    def _end_early(self, position: int) -> None:
        self.index.bytes_unread = self._size - position
        if position + RECORD.size > self._size:
            return
        self._stream.seek(position)
        if self._stream.read(1)[0] == Opcode.CHUNK:
            self._block(position, self._size, cut=True)


def _plausible(opcode: int) -> bool:
    return 0 < opcode <= _LAST_OPCODE or opcode >= _FIRST_PRIVATE_OPCODE


def scan(stream: BinaryIO, size: int) -> McapIndex:
    """An index made by going through the file, up to where it can be read.

    Parameters
    ----------
    stream : binary file
    size : int, [bytes]

    Returns
    -------
    McapIndex
    """
    going = _Scan(stream, size)
    going.go()
    return going.index
