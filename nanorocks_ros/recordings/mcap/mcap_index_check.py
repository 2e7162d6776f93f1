"""Whether the index of an MCAP file agrees with itself; if not, the file is scanned.

Tested by ``test/recordings/mcap/test_mcap_bombs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.recordings.mcap.mcap_blocks import MAGIC
from nanorocks_ros.recordings.storage import LAST_NS

if TYPE_CHECKING:
    from mcap.records import Statistics

    from nanorocks_ros.recordings.mcap.mcap_blocks import Block
    from nanorocks_ros.recordings.mcap.mcap_catalogue import Catalogue


def is_consistent(
    blocks: list[Block], catalogue: Catalogue, statistics: Statistics, size: int
) -> bool:
    """Whether chunks, counts and times of an index agree.

    Parameters
    ----------
    blocks : list of Block
    catalogue : Catalogue
    statistics : Statistics
    size : int, [bytes]
        Of the file.
    """
    counts = statistics.channel_message_counts
    return (
        sum(counts.values()) == statistics.message_count
        and set(counts) <= set(catalogue.channels)
        and _lie_apart(blocks, size)
        and (bool(blocks) or not statistics.message_count)
        and statistics.message_end_time <= LAST_NS
        and _has_these_times(blocks, statistics)
    )


def _lie_apart(blocks: list[Block], size: int) -> bool:
    """Whether all blocks lie in a file of this size, and none in another."""
    end = len(MAGIC)
    for block in sorted(blocks, key=lambda block: block.offset):
        if block.offset < end:
            return False
        end = block.offset + block.length
    return end <= size


def _has_these_times(blocks: list[Block], statistics: Statistics) -> bool:
    """Whether the statistics state the times of the blocks; those without messages have none."""
    filled = [block for block in blocks if block.start_ns or block.end_ns]
    if not filled:
        return True
    times = min(block.start_ns for block in filled), max(block.end_ns for block in filled)
    return times == (statistics.message_start_time, statistics.message_end_time)
