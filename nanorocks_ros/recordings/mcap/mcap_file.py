"""Read an MCAP file, also a truncated or damaged one: all readable messages in order of time.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.mcap.mcap_blocks import (
    MAGIC,
    Block,
    StoredMessage,
    indexed_count_after,
    load,
)
from nanorocks_ros.recordings.mcap.mcap_chunks import DamagedError, TooLargeError
from nanorocks_ros.recordings.mcap.mcap_index import McapIndex, read_index, recorder_notes
from nanorocks_ros.recordings.mcap.mcap_notices import damage_notices
from nanorocks_ros.recordings.mcap.mcap_overlap import WaitingBlocks
from nanorocks_ros.recordings.mcap.mcap_scan import scan
from nanorocks_ros.recordings.offered_qos import recorded_qos
from nanorocks_ros.recordings.storage import BagMessage, TopicInfo
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path
    from typing import BinaryIO

# Log times of MCAP have 64 bits.
_FOREVER = 2**64


class McapFile:
    """An MCAP file; only chunks that overlap in time are in memory at once.

    Parameters
    ----------
    path : Path
    salvaging : bool
        Read a file whose first bytes are damaged, too.

    Attributes
    ----------
    path : Path
    topics : dict of str to TopicInfo
    start_ns, end_ns : int, [ns]
    recorder_notes : str
        Copy of ``metadata.yaml`` that some recorders store in the file; empty if there is none.

    Raises
    ------
    RecordingError
        If it is not an MCAP file.
    """

    def __init__(self, path: Path, *, salvaging: bool = False) -> None:
        self.path = path
        with path.open('rb') as stream:
            size = stream.seek(0, 2)
            start, self._has_magic = self._read_magic(stream, size, salvaging)
            # A salvage does not trust the index, which may lead nowhere or past messages.
            index = None if salvaging else read_index(stream, size)
            self._index: McapIndex = index or scan(stream, size, salvaging=salvaging)
            if not (self._has_magic or self._index.ended or self._index.blocks):
                raise self._not_mcap_error(start)
            self.recorder_notes = recorder_notes(stream, self._index)
        self.topics = _topics(self._index)
        self.start_ns = self._index.start_ns or 0
        self.end_ns = self._index.end_ns or 0

    def _read_magic(self, stream: BinaryIO, size: int, salvaging: bool) -> tuple[bytes, bool]:
        """The first bytes, and whether they are the magic bytes of MCAP."""
        stream.seek(0)
        start = stream.read(len(MAGIC))
        if MAGIC.startswith(start) or salvaging:
            return start, MAGIC.startswith(start)
        stream.seek(max(0, size - len(MAGIC)))
        raise self._not_mcap_error(start, ends_with_magic=stream.read() == MAGIC)

    def _not_mcap_error(self, start: bytes, *, ends_with_magic: bool = False) -> RecordingError:
        suffix, remedy = '', 'pass a rosbag2 folder or an .mcap file'
        if ends_with_magic:
            suffix = ', but ends like an MCAP file'
            remedy = 'run nanorocks salvage to recover the readable messages'
        return RecordingError(
            str(self.path), f'is not an MCAP file (begins with {start!r}){suffix}', remedy
        )

    @property
    def complete(self) -> bool:
        """Whether no data loss has been found so far."""
        return self._index.intact

    @property
    def messages_lost(self) -> int:
        """Number of lost messages found so far; those behind a truncation are not known."""
        return self._index.known_losses + max(0, self._index.miscount)

    @property
    def notices(self) -> tuple[str, ...]:
        """Damage and recovery found so far, in sentences."""
        notices = damage_notices(self._index)
        if not self._index.ended:
            notices.insert(0, self._truncation_text())
        if not self._has_magic:
            notices.insert(0, 'its first bytes are damaged; the rest is read')
        return tuple(f'{self.path}: {notice}' for notice in notices)

    def _truncation_text(self) -> str:
        seconds = (self.end_ns - self.start_ns) / NS
        count = sum(info.count for info in self.topics.values())
        return (
            f'is cut short; {count} messages over {seconds:.3f} s are readable, '
            f'{self._index.bytes_unread} bytes at the end hold no complete record'
        )

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """Readable messages of the given topics, or all, in order of log time.

        Parameters
        ----------
        topics : collection of str, optional
        start_ns, end_ns : int, optional, [ns]
            First and last log time; chunks outside this range are not read.

        Yields
        ------
        BagMessage
        """
        wanted = None if topics is None else frozenset(topics)
        first = 0 if start_ns is None else start_ns
        last = _FOREVER if end_ns is None else end_ns
        # Blocks and messages share a queue: a block is loaded at the time of its first message.
        queue: list[tuple[int, int, int, Block | StoredMessage]] = [
            (block.start_ns, block.offset, -1, block)
            for block in self._index.blocks
            if block.start_ns <= last
            and block.end_ns >= first
            and self._may_contain(block, wanted)
        ]
        heapq.heapify(queue)
        waiting = WaitingBlocks()
        with self.path.open('rb') as stream:
            while queue:
                _, offset, _, item = heapq.heappop(queue)
                if isinstance(item, StoredMessage):
                    waiting.take(offset)
                    yield self._message(item)
                    continue
                messages = [
                    message
                    for message in self._load(stream, item)
                    if first <= message.log_time_ns <= last
                    and self._is_wanted(message.channel, wanted)
                ]
                try:
                    waiting.add(offset, messages)
                except TooLargeError as error:
                    self._leave_out(stream, item, error)
                    continue
                for number, message in enumerate(messages):
                    heapq.heappush(queue, (message.log_time_ns, offset, number, message))

    def _may_contain(self, block: Block, wanted: frozenset[str] | None) -> bool:
        if wanted is None or block.channels is None:
            return True
        return any(self._is_wanted(channel, wanted) for channel in block.channels)

    def _is_wanted(self, channel: int, wanted: frozenset[str] | None) -> bool:
        record = self._index.catalogue.channels.get(channel)
        return record is not None and (wanted is None or record.topic in wanted)

    def _load(self, stream: BinaryIO, block: Block) -> list[StoredMessage]:
        index = self._index
        try:
            messages = load(stream, block, index.catalogue)
        except DamagedError as error:
            self._leave_out(stream, block, error)
            return []
        if block.indexed_bytes:
            self._compare_with_index(stream, block, len(messages))
        messages = index.with_valid_times(block.offset, messages)
        orphans = sum(m.channel not in index.catalogue.channels for m in messages)
        if orphans:
            index.lost[block.offset] = orphans
        index.read[block.offset] = len(messages) - orphans
        return messages

    def _leave_out(self, stream: BinaryIO, block: Block, error: DamagedError) -> None:
        index = self._index
        if isinstance(error, TooLargeError):
            index.refusals.add(str(error))
        index.lost[block.offset] = indexed_count_after(stream, block) or 0
        index.read[block.offset] = 0

    def _compare_with_index(self, stream: BinaryIO, block: Block, count: int) -> None:
        """Count messages that the message indexes list and that a readable chunk lacks."""
        indexed = indexed_count_after(stream, block)
        if indexed is not None and indexed > count:
            self._index.lost[block.offset] = indexed - count
        elif indexed != count:
            self._index.disagreements.add(block.offset)

    def _message(self, message: StoredMessage) -> BagMessage:
        topic = self._index.catalogue.channels[message.channel].topic
        # Not `topics[topic]`: a damaged index may lack a channel that a chunk declares.
        info = self.topics.get(topic)
        return BagMessage(
            topic=topic,
            type=info.type if info else '',
            log_time_ns=message.log_time_ns,
            cdr=bytes(message.data),
        )


def _topics(index: McapIndex) -> dict[str, TopicInfo]:
    topics: dict[str, TopicInfo] = {}
    for number, channel in sorted(index.catalogue.channels.items()):
        schema = index.catalogue.schemas.get(channel.schema_id)
        before = topics.get(channel.topic)
        topics[channel.topic] = TopicInfo(
            name=channel.topic,
            type=before.type if before else schema.name if schema else '',
            count=index.counts[number] + (before.count if before else 0),
            encoding=channel.message_encoding,
            definition=schema.data.decode('utf-8', 'replace') if schema else '',
            definition_format=schema.encoding if schema else '',
            qos=recorded_qos(channel.metadata.get('offered_qos_profiles', '')),
        )
    return topics
