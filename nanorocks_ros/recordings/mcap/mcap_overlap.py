"""Memory of chunks that overlap in time: all of them are unpacked at once.

Tested by ``test/recordings/mcap/test_mcap_bombs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.limits import OVERLAP_BYTES
from nanorocks_ros.recordings.mcap.mcap_chunks import TooLargeError

if TYPE_CHECKING:
    from nanorocks_ros.recordings.mcap.mcap_blocks import StoredMessage

# Memory of a message beside its content, [bytes].
_MESSAGE_BYTES = 400


class WaitingBlocks:
    """Blocks with messages that wait for their turn."""

    def __init__(self) -> None:
        # Number of waiting messages, and size, by the offset of a block.
        self._blocks: dict[int, tuple[int, int]] = {}
        self._size = 0

    def add(self, offset: int, waiting: list[StoredMessage]) -> None:
        """Add the messages of a block that wait.

        Raises
        ------
        TooLargeError
            If there is no room for them beside those that wait already.
        """
        if not waiting:
            return
        # A message keeps all of its block.
        content = waiting[0].data.obj
        size = memoryview(content).nbytes + _MESSAGE_BYTES * len(waiting)
        if self._blocks and self._size + size > OVERLAP_BYTES.value:
            raise TooLargeError(OVERLAP_BYTES)
        self._blocks[offset] = len(waiting), size
        self._size += size

    def take(self, offset: int) -> None:
        """One message of a block is used."""
        count, size = self._blocks.pop(offset)
        if count > 1:
            self._blocks[offset] = count - 1, size
        else:
            self._size -= size
