"""Where the messages of an MCAP file lie, from the index at its end."""

from __future__ import annotations

import zlib
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Footer, Metadata, MetadataIndex, Statistics

from nanorocks_ros.recordings.mcap.mcap_blocks import (
    MAGIC,
    RECORD,
    UNREADABLE,
    Block,
    Catalogue,
    StoredMessage,
    stream_of,
    walk,
)
from nanorocks_ros.recordings.storage import LAST_NS

if TYPE_CHECKING:
    from typing import BinaryIO

_ROSBAG2 = 'rosbag2'
_FOOTER_BYTES = RECORD.size + 20


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
    untimely : dict of int to int
        Messages with a time that cannot be, by the offset of their block; they are left out.
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
    untimely: dict[int, int] = field(default_factory=dict)
    ended: bool = False
    bytes_unread: int = 0
    metadata_at: list[tuple[int, int]] = field(default_factory=list)

    def timely(self, block: int, messages: list[StoredMessage]) -> list[StoredMessage]:
        """Those with a time that can be; the others of a block are counted as lost."""
        found = [message for message in messages if message.log_time_ns <= LAST_NS]
        if len(found) < len(messages):
            self.untimely[block] = len(messages) - len(found)
        return found

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
        and statistics.message_end_time <= LAST_NS
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
