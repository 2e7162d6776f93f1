"""Index of the messages in an MCAP file, read from the summary at its end.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

import zlib
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Footer, Metadata, MetadataIndex, Statistics

from nanorocks_ros.limits import SUMMARY_BYTES, YAML_BYTES
from nanorocks_ros.recordings.mcap.mcap_blocks import (
    MAGIC,
    RECORD,
    Block,
    StoredMessage,
    iterate_records,
)
from nanorocks_ros.recordings.mcap.mcap_catalogue import Catalogue, data_stream
from nanorocks_ros.recordings.mcap.mcap_chunks import UNREADABLE
from nanorocks_ros.recordings.mcap.mcap_index_check import is_consistent
from nanorocks_ros.recordings.storage import LAST_NS

if TYPE_CHECKING:
    from typing import BinaryIO

_ROSBAG2 = 'rosbag2'
_FOOTER_BYTES = RECORD.size + 20


@dataclass(slots=True, kw_only=True)
class McapIndex:
    """Positions and counts of the messages in a file.

    Attributes
    ----------
    blocks : list of Block
    catalogue : Catalogue
    counts : Counter of int
        Number of messages by channel.
    start_ns, end_ns : int or None, [ns]
        Log times of the first and last message.
    lost : dict of int to int
        Number of lost messages in each damaged block, by its offset.
    invalid_times : dict of int to int
        Number of skipped messages with impossible time stamps, by the offset of their block.
    ended : bool
        Whether the file has its footer.
    bytes_unread : int
        Number of bytes at the end of a truncated file that contain no complete record.
    bytes_behind : int
        Number of bytes behind the footer of a scanned file, which are not read.
    metadata_at : list of (int, int)
        Offset and length of the metadata records of rosbag2, [bytes].
    stated : int or None
        Number of messages according to the statistics of the file; None if it has none.
    repaired : set of int
        Offsets of chunks that were read although their heads are damaged.
    disagreements : set of int
        Offsets of chunks with more messages than their message indexes list.
    unverified : dict of int to int
        Number of messages used from chunks whose checksums are wrong, by their offsets.
    unknown_records : int
        Number of skipped records of a kind that the format leaves to applications.
    refusals : set of str
        Limits that the file exceeds.
    wrong_checksum : bool
        Whether the data outside chunks differ from their checksum.
    read : dict of int to int
        Number of messages in each block that was read by the index, by its offset.
    scanned : bool
        Whether the file was scanned; otherwise its own index was read.
    """

    blocks: list[Block] = field(default_factory=list)
    catalogue: Catalogue = field(default_factory=Catalogue)
    counts: Counter[int] = field(default_factory=Counter)
    start_ns: int | None = None
    end_ns: int | None = None
    lost: dict[int, int] = field(default_factory=dict)
    invalid_times: dict[int, int] = field(default_factory=dict)
    ended: bool = False
    bytes_unread: int = 0
    bytes_behind: int = 0
    metadata_at: list[tuple[int, int]] = field(default_factory=list)
    stated: int | None = None
    repaired: set[int] = field(default_factory=set)
    disagreements: set[int] = field(default_factory=set)
    unverified: dict[int, int] = field(default_factory=dict)
    unknown_records: int = 0
    refusals: set[str] = field(default_factory=set)
    read: dict[int, int] = field(default_factory=dict)
    scanned: bool = False
    wrong_checksum: bool = False

    @property
    def total(self) -> int:
        """Number of messages that were found."""
        return self.counts.total()

    @property
    def miscount(self) -> int:
        """Messages that the statistics count and that are not there; below 0 for too many.

        Without a scan this is known once all blocks have been read.
        """
        if self.stated is None:
            return 0
        if self.scanned:
            return self.stated - self.total - self.known_losses
        if len(self.read) < len(self.blocks):
            return 0
        return self.stated - sum(self.read.values()) - self.known_losses

    @property
    def known_losses(self) -> int:
        """Messages in damaged blocks and with impossible times."""
        return sum(self.lost.values()) + sum(self.invalid_times.values())

    @property
    def intact(self) -> bool:
        """Whether nothing was found to be wrong so far."""
        return self.ended and not (
            self.lost
            or self.invalid_times
            or self.repaired
            or self.disagreements
            or self.unverified
            or self.catalogue.contradictions
            or self.refusals
            or self.wrong_checksum
            or self.bytes_behind
            or self.miscount
            or (self.unknown_records and self.stated is None)
        )

    def with_valid_times(self, block: int, messages: list[StoredMessage]) -> list[StoredMessage]:
        """Messages of a block with possible time stamps; the others are counted as lost."""
        valid = [message for message in messages if message.log_time_ns <= LAST_NS]
        if len(valid) < len(messages):
            self.invalid_times[block] = len(messages) - len(valid)
        return valid

    def add_block(self, block: Block, messages: list[StoredMessage]) -> None:
        """Add a block that was read, with the times and channels of its messages."""
        if not messages:
            return
        self.count(messages)
        times = [message.log_time_ns for message in messages]
        channels = frozenset(message.channel for message in messages)
        self.blocks.append(
            replace(block, start_ns=min(times), end_ns=max(times), channels=channels)
        )

    def count(self, messages: list[StoredMessage]) -> None:
        """Add messages to the counts and to the time range."""
        for message in messages:
            self.counts[message.channel] += 1
        times = [message.log_time_ns for message in messages]
        self.start_ns = min((t for t in (self.start_ns, *times) if t is not None), default=None)
        self.end_ns = max((t for t in (self.end_ns, *times) if t is not None), default=None)


def read_index(stream: BinaryIO, size: int) -> McapIndex | None:
    """Read the index at the end of an intact file.

    Parameters
    ----------
    stream : binary file
    size : int, [bytes]

    Returns
    -------
    McapIndex or None
        None if there is none or it is inconsistent.
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
    footer = Footer.read(data_stream(end[RECORD.size :]))
    has_footer = end[0] == Opcode.FOOTER and end.endswith(MAGIC)
    if not has_footer or not len(MAGIC) <= footer.summary_start < footer_at:
        return None
    if footer_at - footer.summary_start > SUMMARY_BYTES.value:
        return None
    stream.seek(footer.summary_start)
    summary = stream.read(footer_at - footer.summary_start)
    checksummed = summary + end[: RECORD.size + 16]
    if footer.summary_crc and zlib.crc32(checksummed) != footer.summary_crc:
        return None
    return _from_summary(memoryview(summary), size)


def add_summary(index: McapIndex, stream: BinaryIO, position: int) -> None:
    """Add the copies of channels and schemas behind the data of a scanned file, and its counts.

    Parameters
    ----------
    index : McapIndex
    stream : binary file
    position : int, [bytes]
        Where the summary section begins.
    """
    # A buffer of the size that is asked for is made before anything is read.
    most = min(SUMMARY_BYTES.value, stream.seek(0, 2) - position)
    stream.seek(position)
    summary = memoryview(stream.read(max(0, most)))
    try:
        for opcode, content in iterate_records(summary, cut=True):
            if opcode == Opcode.STATISTICS:
                statistics = Statistics.read(data_stream(content))
                if sum(statistics.channel_message_counts.values()) == statistics.message_count:
                    index.stated = statistics.message_count
            elif opcode == Opcode.METADATA_INDEX:
                _add_metadata(index, content)
            else:
                index.catalogue.add(opcode, content)
    except UNREADABLE:
        return


def _add_metadata(index: McapIndex, content: memoryview) -> None:
    entry = MetadataIndex.read(data_stream(content))
    if entry.name == _ROSBAG2:
        index.metadata_at.append((entry.offset, entry.length))


def _from_summary(summary: memoryview, size: int) -> McapIndex | None:
    index = McapIndex(ended=True)
    statistics: Statistics | None = None
    for opcode, content in iterate_records(summary):
        if opcode == Opcode.CHUNK_INDEX:
            index.blocks.append(_chunk_block(ChunkIndex.read(data_stream(content))))
        elif opcode == Opcode.METADATA_INDEX:
            _add_metadata(index, content)
        elif opcode == Opcode.STATISTICS:
            statistics = Statistics.read(data_stream(content))
        else:
            index.catalogue.add(opcode, content)
    if statistics is None or statistics.chunk_count != len(index.blocks):
        return None
    index.counts = Counter(statistics.channel_message_counts)
    index.stated = statistics.message_count
    if not is_consistent(index.blocks, index.catalogue, statistics, size):
        return None
    if statistics.message_count:
        index.start_ns = statistics.message_start_time
        index.end_ns = statistics.message_end_time
    return index


def recorder_notes(stream: BinaryIO, index: McapIndex) -> str:
    """Copy of ``metadata.yaml`` that rosbag2 stores in the file; empty if there is none."""
    size = stream.seek(0, 2)
    for offset, length in index.metadata_at:
        if offset + length > size or length > YAML_BYTES.value:
            continue
        stream.seek(offset)
        try:
            for opcode, content in iterate_records(memoryview(stream.read(length))):
                if opcode == Opcode.METADATA:
                    notes = Metadata.read(data_stream(content)).metadata
                    return str(notes.get('serialized_metadata', ''))
        except UNREADABLE:
            continue
    return ''


def _chunk_block(entry: ChunkIndex) -> Block:
    return Block(
        offset=entry.chunk_start_offset,
        length=entry.chunk_length,
        start_ns=entry.message_start_time,
        end_ns=entry.message_end_time,
        # Writers may omit the message indexes; then the chunk may contain any channel.
        channels=frozenset(entry.message_index_offsets) or None,
        indexed_bytes=entry.message_index_length,
        chunk=True,
        indexed=True,
    )
