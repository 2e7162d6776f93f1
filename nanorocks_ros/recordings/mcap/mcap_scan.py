"""Build the index of an MCAP file that has none, by scanning the file.

The scan trusts no length alone: a record counts if its fields fill it, a chunk if it can be
unpacked. Behind anything else it looks for the next place where sound records begin, so an intact
chunk behind missing or inserted bytes is read.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from nanorocks_ros.recordings.mcap.mcap_blocks import (
    MAGIC,
    Block,
    indexed_count_at,
    load,
    recover_catalogue,
)
from nanorocks_ros.recordings.mcap.mcap_checksum import is_data_intact
from nanorocks_ros.recordings.mcap.mcap_chunks import DamagedError, TooLargeError
from nanorocks_ros.recordings.mcap.mcap_heads import (
    FIRST_PRIVATE,
    ChunkExtent,
    Head,
    chunk_extent,
    read_head,
)
from nanorocks_ros.recordings.mcap.mcap_index import McapIndex, add_summary
from nanorocks_ros.recordings.mcap.mcap_resync import is_record, next_record, records_follow

if TYPE_CHECKING:
    from typing import BinaryIO

# Messages outside chunks are joined to runs of about this size.
_RUN_BYTES = 1 << 20
_OF_A_RUN = (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
# Records that end the data section.
_END_OF_DATA = (Opcode.DATA_END, Opcode.FOOTER)


class _Scanner:
    """Scan a file from its beginning, as far as it can be read."""

    def __init__(self, stream: BinaryIO, size: int, *, salvaging: bool) -> None:
        self._stream = stream
        self._size = size
        self._salvaging = salvaging
        # Records that were joined to a run: where the first and the last begin, and its end.
        self._run: tuple[int, int, int] | None = None
        # The damage that the message indexes behind it may count, and messages read behind it.
        self._damaged: int | None = None
        self._indexed = self._recovered = 0
        # Whether the messages behind it belong to a chunk whose checksum is wrong.
        self._descended = False
        self._boundary = 0
        # From where a record that is no message was looked for last, and where it is.
        self._telling: tuple[int, int | None] = (size, None)
        # Kinds of records on the top level so far.
        self._chunked = self._unchunked = self._packed = False
        self._at_end_of_data = False
        self.index = McapIndex(scanned=True)

    def run(self) -> None:
        position = len(MAGIC)
        while (head := read_head(self._stream, position, self._size)) is not None:
            following = self._step(head)
            if following is None:
                break
            position = following
            if self._at_end_of_data:
                self._end_run()
                self._settle_damage()
                self.index.ended, self.index.bytes_behind = self._end_of_file(head)
                add_summary(self.index, self._stream, head.end)
                return
        self._end_run()
        self._settle_damage()
        self._note_truncation(min(position, self._size))

    def _step(self, head: Head) -> int | None:
        """Handle a record; where the next begins, None at the end of what can be read."""
        if self._may_be_chunk(head):
            extent = chunk_extent(self._stream, head)
            if extent is not None:
                return self._step_chunk(head, extent)
        if is_record(self._stream, head, self._size):
            self._handle_record(head)
            return head.end
        if head.opcode >= FIRST_PRIVATE and records_follow(self._stream, head.end, self._size):
            self._end_run()
            self.index.unknown_records += 1
            return head.end
        return self._skip(head.start)

    def _may_be_chunk(self, head: Head) -> bool:
        """Whether it is worth to look for a chunk here, whatever the opcode says."""
        if head.opcode == Opcode.CHUNK:
            return True
        return not (self._unchunked or is_record(self._stream, head, self._size))

    # --- chunks ------------------------------------------------------------------------------

    def _step_chunk(self, head: Head, extent: ChunkExtent) -> int | None:
        self._end_run()
        self._settle_damage()
        self._chunked = True
        self._packed = self._packed or extent.compressed
        readable = [end for end in extent.ends if end <= self._size]
        if not readable:
            return self._step_cut_chunk(head)
        damaged_head = head.opcode != Opcode.CHUNK or len(extent.ends) > 1
        for end in readable:
            if self._add_block(head.start, end, chunk=True):
                if damaged_head:
                    self.index.repaired.add(head.start)
                return end
        if self._salvaging and not extent.compressed:
            # Its records are read one by one; their checksum is known to be wrong, or unknown.
            self._mark_damage(head.start)
            self._descended = True
            self._boundary = readable[0]
            return extent.content
        return self._leave_damaged_chunk(head, readable)

    def _leave_damaged_chunk(self, head: Head, ends: list[int]) -> int | None:
        """Continue behind a damaged chunk, whose length counts only if records follow."""
        end = next((e for e in ends if records_follow(self._stream, e, self._size)), None)
        if end is None:
            return self._skip(head.start)
        self._mark_damage(head.start)
        if self._salvaging:
            self._recovered = self._add_block(head.start, end, chunk=True, unverified=True)
            self._descended = self._recovered > 0
        return end

    def _step_cut_chunk(self, head: Head) -> int | None:
        """A chunk that ends behind the file: the file was cut, or bytes are missing in it."""
        following = self._next_record(head.start)
        if following is not None:
            self._mark_damage(head.start)
        return following

    # --- records -----------------------------------------------------------------------------

    def _handle_record(self, head: Head) -> None:
        self._at_end_of_data = head.opcode in _END_OF_DATA
        if head.opcode == Opcode.DATA_END and self._unchunked:
            self.index.wrong_checksum = not is_data_intact(self._stream, head.start)
        if head.opcode == Opcode.MESSAGE_INDEX:
            self._end_run()
            if self._damaged is not None:
                self._indexed += indexed_count_at(self._stream, head.start, head.end)
            return
        if head.opcode == Opcode.MESSAGE and self._damaged is None:
            self._unchunked = True
        if head.opcode in _OF_A_RUN:
            start = self._run[0] if self._run else head.start
            self._run = (start, head.start, head.end)
            if head.end - start >= _RUN_BYTES:
                self._end_run()
            return
        self._end_run()

    def _end_run(self) -> None:
        if self._run is not None:
            (start, _, end), self._run = self._run, None
            self._add_block(start, end, chunk=False)

    # --- damage ------------------------------------------------------------------------------

    def _skip(self, position: int) -> int | None:
        """Leave out damaged bytes; where sound records begin again, None if nowhere."""
        suspect = self._run[1] if self._run else position
        following = self._next_record(suspect)
        if following is None:
            return None
        if self._run and following < position:
            # The length of the last record of the run is wrong: it holds the next ones.
            start, last, _ = self._run
            self._run = (start, last, last) if last > start else None
            position = last
        self._end_run()
        if not self._descended:
            self._mark_damage(position)
        recover_catalogue(self._stream, position, following, self.index.catalogue)
        return following

    def _next_record(self, position: int) -> int | None:
        """Offset of the next sound records behind a damaged one; None if there are none."""
        if self._unchunked:
            return self._next_message(position)
        telling = self._next_telling(position)
        self._note_kind(telling)
        # Compressed chunks hold parts of messages by chance, too: those are not looked for.
        if self._chunked and (self._packed or not self._salvaging):
            return telling
        return self._next_message(position)

    def _next_message(self, position: int) -> int | None:
        return next_record(
            self._stream, position + 1, self._size, messages=True, boundary=self._boundary
        )

    def _next_telling(self, position: int) -> int | None:
        """The next record that is no message; looked for once, however many damages are before."""
        searched, telling = self._telling
        if not searched <= position or (telling is not None and telling <= position):
            telling = next_record(self._stream, position + 1, self._size, messages=False)
            self._telling = position, telling
        return telling

    def _note_kind(self, position: int | None) -> None:
        """Learn from a record behind damage that the file has chunks, compressed or not."""
        head = None if position is None else read_head(self._stream, position, self._size)
        if head is not None and head.opcode in (Opcode.CHUNK, Opcode.MESSAGE_INDEX):
            extent = chunk_extent(self._stream, head)
            if extent is not None:
                self._packed = self._packed or extent.compressed
            elif not self._chunked:
                # Nothing is known of the chunks: they may be compressed.
                self._packed = True
            self._chunked = True

    def _mark_damage(self, position: int) -> None:
        self._settle_damage()
        self._damaged = position
        self.index.lost[position] = 0

    def _settle_damage(self) -> None:
        """Count what was lost at the last damage, by the message indexes behind it."""
        if self._damaged is not None:
            lost = max(0, self._indexed - self._recovered)
            self.index.lost[self._damaged] = lost
            if self._descended and self._recovered:
                self.index.unverified[self._damaged] = self._recovered
                if not lost:
                    del self.index.lost[self._damaged]
        self._damaged, self._descended = None, False
        self._indexed = self._recovered = 0

    # --- results -----------------------------------------------------------------------------

    def _add_block(
        self, start: int, end: int, *, chunk: bool, cut: bool = False, unverified: bool = False
    ) -> int:
        """Read a block and add it to the index; its number of messages, 0 if it is damaged."""
        unread = Block(
            offset=start,
            length=end - start,
            start_ns=0,
            end_ns=0,
            channels=None,
            cut=cut,
            chunk=chunk,
            unverified=unverified,
        )
        try:
            messages = load(self._stream, unread, self.index.catalogue)
        except DamagedError as error:
            if isinstance(error, TooLargeError):
                self.index.refusals.add(str(error))
            if not (cut or chunk or self._damaged is not None):
                self._mark_damage(start)
            return 0
        count = len(messages)
        if not chunk:
            self._recovered += count
        messages = self.index.with_valid_times(start, messages)
        self.index.add_block(unread, messages)
        return max(count, int(chunk and not unverified))

    def _end_of_file(self, head: Head) -> tuple[bool, int]:
        """Whether the file ends as it should, and how many bytes stand behind its footer."""
        self._stream.seek(self._size - len(MAGIC))
        has_magic = self._stream.read() == MAGIC
        last: Head | None = head
        while last is not None and last.opcode != Opcode.FOOTER:
            last = read_head(self._stream, last.end, self._size)
        behind = 0 if last is None else self._size - last.end - len(MAGIC)
        return has_magic, max(0, behind)

    def _note_truncation(self, position: int) -> None:
        self.index.bytes_unread = self._size - position
        head = read_head(self._stream, position, self._size)
        if head is not None and head.opcode == Opcode.CHUNK:
            self._add_block(position, self._size, chunk=True, cut=True)


def scan(stream: BinaryIO, size: int, *, salvaging: bool = False) -> McapIndex:
    """Build an index by scanning a file of this size, [bytes], as far as it can be read.

    For a salvage messages of chunks whose checksum is wrong are used, too, and counted.
    """
    scanner = _Scanner(stream, size, salvaging=salvaging)
    scanner.run()
    return scanner.index
