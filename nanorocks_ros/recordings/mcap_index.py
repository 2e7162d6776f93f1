"""Where the messages of an MCAP file lie: from its own index, or by going through the file."""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Footer, Metadata, MetadataIndex, Statistics

from nanorocks_ros.recordings.mcap_blocks import (
    MAGIC,
    RECORD,
    UNREADABLE,
    Block,
    Catalogue,
    DamagedError,
    StoredMessage,
    gather_names,
    indexed_messages,
    load,
    stream_of,
    walk,
)

if TYPE_CHECKING:
    from typing import BinaryIO

_ROSBAG2 = 'rosbag2'
_FOOTER_BYTES = RECORD.size + 20
# Messages outside chunks are read in runs of about this many bytes.
_RUN_BYTES = 1 << 20
_LAST_OPCODE = 0x0F
_FIRST_PRIVATE_OPCODE = 0x80
# Where chunks and indexes of messages begin that are shorter than 4 GB; messages only in files
# that have them outside of chunks: inside, compression may have put bytes of its own into them.
_CHUNK_START = re.compile(rb'[\x06\x07][\s\S]{4}\x00{4}')
_MESSAGE_START = re.compile(rb'[\x05\x06\x07][\s\S]{4}\x00{4}')
_IN_A_ROW = 3
# Times, size and checksum in the head of a chunk, and the length of the name of its compression.
_CHUNK_HEAD = struct.Struct('<QQQII')
_LONGEST_NAME = 16
# What may stand at the top of a file besides chunks and messages, and is not needed here.
_END_OF_DATA = (Opcode.DATA_END, Opcode.FOOTER)


@dataclass(slots=True, kw_only=True)
class McapIndex:
    """Where the messages of a file lie.

    Attributes
    ----------
    blocks : list of Block
    catalogue : Catalogue
    counts : Counter of int
        Messages by channel.
    start_ns, end_ns : int or None, [ns]
        Log times of the first and last message.
    lost : dict of int to int
        Messages lost in each damaged block, by its offset.
    ended : bool
        The file has the end that it was meant to have.
    bytes_unread : int
        At the end of a file cut short, holding no whole message.
    metadata_at : list of (int, int)
        Offset and length of what rosbag2 says of the recording, [bytes].
    """

    blocks: list[Block] = field(default_factory=list)
    catalogue: Catalogue = field(default_factory=Catalogue)
    counts: Counter[int] = field(default_factory=Counter)
    start_ns: int | None = None
    end_ns: int | None = None
    lost: dict[int, int] = field(default_factory=dict)
    ended: bool = False
    bytes_unread: int = 0
    metadata_at: list[tuple[int, int]] = field(default_factory=list)

    def count(self, messages: list[StoredMessage]) -> None:
        """Take messages into account."""
        for message in messages:
            self.counts[message.channel] += 1
        times = [message.log_time_ns for message in messages]
        self.start_ns = min((t for t in (self.start_ns, *times) if t is not None), default=None)
        self.end_ns = max((t for t in (self.end_ns, *times) if t is not None), default=None)


def read_index(stream: BinaryIO, size: int) -> McapIndex | None:
    """The index that a whole file carries at its end.

    Parameters
    ----------
    stream : binary file
    size : int, [bytes]

    Returns
    -------
    McapIndex or None
        None when there is none, or none that can be relied upon.
    """
    try:
        return _read_index(stream, size)
    except UNREADABLE:
        return None


def _read_index(stream: BinaryIO, size: int) -> McapIndex | None:
    footer_at = size - len(MAGIC) - _FOOTER_BYTES
    if footer_at < len(MAGIC):
        return None
    stream.seek(footer_at)
    end = stream.read()
    footer = Footer.read(stream_of(end[RECORD.size :]))
    known = end[0] == Opcode.FOOTER and end.endswith(MAGIC)
    if not known or not len(MAGIC) <= footer.summary_start < footer_at:
        return None
    stream.seek(footer.summary_start)
    summary = stream.read(footer_at - footer.summary_start)
    checked = summary + end[: RECORD.size + 16]
    if footer.summary_crc and zlib.crc32(checked) != footer.summary_crc:
        return None
    return _from_summary(memoryview(summary), size)


def _from_summary(summary: memoryview, size: int) -> McapIndex | None:
    index = McapIndex(ended=True)
    statistics: Statistics | None = None
    for opcode, content in walk(summary):
        if opcode == Opcode.CHUNK_INDEX:
            index.blocks.append(_block_of(ChunkIndex.read(stream_of(content))))
        elif opcode == Opcode.METADATA_INDEX:
            place = MetadataIndex.read(stream_of(content))
            if place.name == _ROSBAG2:
                index.metadata_at.append((place.offset, place.length))
        elif opcode == Opcode.STATISTICS:
            statistics = Statistics.read(stream_of(content))
        else:
            index.catalogue.note(opcode, content)
    if statistics is None or statistics.chunk_count != len(index.blocks):
        return None
    index.counts = Counter(statistics.channel_message_counts)
    reliable = (
        index.counts.total() == statistics.message_count
        and set(index.counts) <= set(index.catalogue.channels)
        and all(b.offset >= len(MAGIC) and b.offset + b.length <= size for b in index.blocks)
        and (index.blocks or not statistics.message_count)
    )
    if not reliable:
        return None
    if statistics.message_count:
        index.start_ns = statistics.message_start_time
        index.end_ns = statistics.message_end_time
    return index


def recorder_notes(stream: BinaryIO, index: McapIndex) -> str:
    """What rosbag2 keeps in a whole file: a copy of its ``metadata.yaml``; empty without one."""
    size = stream.seek(0, 2)
    for offset, length in index.metadata_at:
        if offset + length > size:
            continue
        stream.seek(offset)
        try:
            for opcode, content in walk(memoryview(stream.read(length))):
                if opcode == Opcode.METADATA:
                    notes = Metadata.read(stream_of(content)).metadata
                    return str(notes.get('serialized_metadata', ''))
        except UNREADABLE:
            continue
    return ''


def _block_of(entry: ChunkIndex) -> Block:
    return Block(
        offset=entry.chunk_start_offset,
        length=entry.chunk_length,
        start_ns=entry.message_start_time,
        end_ns=entry.message_end_time,
        # Writers may leave the message indexes out: then any channel may be inside.
        channels=frozenset(entry.message_index_offsets) or None,
        indexed_bytes=entry.message_index_length,
    )


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
