"""One MCAP file, whole, cut short or damaged: every message that can be read, in order."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.mcap.mcap_blocks import (
    MAGIC,
    Block,
    DamagedError,
    StoredMessage,
    indexed_after,
    load,
)
from nanorocks_ros.recordings.mcap.mcap_index import McapIndex, read_index, recorder_notes
from nanorocks_ros.recordings.mcap.mcap_scan import scan
from nanorocks_ros.recordings.offered_qos import recorded_qos
from nanorocks_ros.recordings.storage import BagMessage, TopicInfo

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path
    from typing import BinaryIO

NS = 1_000_000_000
# Log times have 64 bits.
_FOREVER = 2**64


class McapFile:
    """An MCAP file. No more than the chunks that overlap in time are in memory at once.

    Parameters
    ----------
    path : Path
    salvaging : bool
        Read one whose first bytes are damaged, too.

    Attributes
    ----------
    path : Path
    topics : dict of str to TopicInfo
    start_ns, end_ns : int, [ns]
    recorder_notes : str
        A copy of ``metadata.yaml`` that some recorders keep in the file; empty without one.

    Raises
    ------
    RecordingError
        When it is no MCAP file.
    """

    def __init__(self, path: Path, *, salvaging: bool = False) -> None:
        self.path = path
        with path.open('rb') as stream:
            size = stream.seek(0, 2)
            start, self._begins_well = self._beginning(stream, size, salvaging)
            index = read_index(stream, size)
            self._index: McapIndex = index or scan(stream, size)
            if not (self._begins_well or self._index.ended or self._index.blocks):
                raise self._is_none(start)
            self.recorder_notes = recorder_notes(stream, self._index)
        self.topics = _topics(self._index)
        self.start_ns = self._index.start_ns or 0
        self.end_ns = self._index.end_ns or 0

    def _beginning(self, stream: BinaryIO, size: int, salvaging: bool) -> tuple[bytes, bool]:
        """The first bytes, and whether they are what they should be."""
        stream.seek(0)
        start = stream.read(len(MAGIC))
        if MAGIC.startswith(start) or salvaging:
            return start, MAGIC.startswith(start)
        stream.seek(max(0, size - len(MAGIC)))
        raise self._is_none(start, ends_well=stream.read() == MAGIC)

    def _is_none(self, start: bytes, *, ends_well: bool = False) -> RecordingError:
        what, remedy = '', 'pass a rosbag2 folder or an .mcap file'
        if ends_well:
            what, remedy = ', but ends as one', 'nanorocks salvage recovers what can be read'
        return RecordingError(
            str(self.path), f'is not an MCAP file (begins with {start!r}){what}', remedy
        )

    @property
    def complete(self) -> bool:
        """Nothing is known to be missing, so far."""
        return self._index.ended and not self._index.lost and not self._index.untimely

    @property
    def messages_lost(self) -> int:
        """Messages known to be lost, so far; those beyond a cut are not known."""
        return sum(self._index.lost.values()) + sum(self._index.untimely.values())

    @property
    def notices(self) -> tuple[str, ...]:
        """What was salvaged and what is lost, so far."""
        notices = []
        if not self._begins_well:
            notices.append(f'{self.path}: is damaged at its beginning; the rest is read')
        if not self._index.ended:
            notices.append(f'{self.path}: {self._salvaged()}')
        if self._index.lost:
            blocks, lost = len(self._index.lost), sum(self._index.lost.values())
            notices.append(
                f'{self.path}: {blocks} damaged {"block was" if blocks == 1 else "blocks were"} '
                f'skipped, at least {lost} messages are lost'
            )
        if self._index.untimely:
            count = sum(self._index.untimely.values())
            notices.append(
                f'{self.path}: {count} messages have a time that cannot be and were left out'
            )
        return tuple(notices)

    def _salvaged(self) -> str:
        seconds = (self.end_ns - self.start_ns) / NS
        count = sum(info.count for info in self.topics.values())
        return (
            f'cut short; {count} messages over {seconds:.3f} s salvaged, '
            f'{self._index.bytes_unread} bytes at the end hold no whole record'
        )

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """The messages of some topics, or all, in order of log time; damage is skipped.

        Parameters
        ----------
        topics : collection of str, optional
        start_ns, end_ns : int, optional, [ns]
            Log times of the first and last message wanted; what lies wholly outside is not read.

        Yields
        ------
        BagMessage
        """
        wanted = None if topics is None else frozenset(topics)
        first = 0 if start_ns is None else start_ns
        last = _FOREVER if end_ns is None else end_ns
        # Blocks and messages in one queue: a block is opened when its first message is due.
        queue: list[tuple[int, int, int, Block | StoredMessage]] = [
            (block.start_ns, block.offset, -1, block)
            for block in self._index.blocks
            if block.start_ns <= last and block.end_ns >= first and self._concerns(block, wanted)
        ]
        heapq.heapify(queue)
        with self.path.open('rb') as stream:
            while queue:
                _, offset, _, item = heapq.heappop(queue)
                if isinstance(item, StoredMessage):
                    yield self._message(item)
                    continue
                for number, message in enumerate(self._load(stream, item)):
                    timely = first <= message.log_time_ns <= last
                    if timely and self._is_wanted(message.channel, wanted):
                        entry = (message.log_time_ns, offset, number, message)
                        heapq.heappush(queue, entry)

    def _concerns(self, block: Block, wanted: frozenset[str] | None) -> bool:
        if wanted is None or block.channels is None:
            return True
        return any(self._is_wanted(channel, wanted) for channel in block.channels)

    def _is_wanted(self, channel: int, wanted: frozenset[str] | None) -> bool:
        known = self._index.catalogue.channels.get(channel)
        return known is not None and (wanted is None or known.topic in wanted)

    def _load(self, stream: BinaryIO, block: Block) -> list[StoredMessage]:
        try:
            messages = load(stream, block, self._index.catalogue)
        except DamagedError:
            self._index.lost[block.offset] = indexed_after(stream, block)
            return []
        messages = self._index.timely(block.offset, messages)
        orphans = sum(m.channel not in self._index.catalogue.channels for m in messages)
        if orphans:
            self._index.lost[block.offset] = orphans
        return messages

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
