"""A whole recording from what can be read of a damaged one."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.provenance import COMPLETE, SALVAGE, UNFINISHED
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter, OfferedTopic
from nanorocks_ros.recordings.offered_qos import OfferedQos

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Salvage:
    """What was salvaged.

    Parameters
    ----------
    bag : Path
    recovered : int
        Messages in the new recording.
    lost : int
        Messages known to be lost; how many lie beyond a cut is known only where the recorder
        counted them.
    notices : tuple of str
        What was wrong.
    """

    bag: Path
    recovered: int
    lost: int
    notices: tuple[str, ...]


def salvage(source: Path, target: Path, progress: Callable[[int, int], None]) -> Salvage:
    """Copy every message that can be read into a new recording; the old one is only read.

    When it is interrupted, the new one holds what was written until then, and says so.

    Parameters
    ----------
    source : Path
        Damaged, cut short, or without ``metadata.yaml``; MCAP or SQLite.
    target : Path
        Must not exist.
    progress : callable
        Called with the messages done and those there may be.

    Returns
    -------
    Salvage

    Raises
    ------
    RecordingError
        When there is nothing to salvage, or the new recording cannot be written.
    """
    if os.path.lexists(target):
        raise RecordingError(
            str(target), 'exists already and is not overwritten', 'pass another path'
        )
    reader = open_bag(source, salvaging=True)
    held = sum(info.count for info in reader.topics.values())
    if not held:
        raise RecordingError(
            str(source), 'holds no message that can be recovered', 'look for another copy of it'
        )
    table = {
        name: OfferedTopic(
            msgtype=info.type,
            qos=info.qos or OfferedQos(),
            definition=info.definition,
            definition_format=info.definition_format,
            encoding=info.encoding,
            verbatim=True,
        )
        for name, info in reader.topics.items()
    }
    recovered = 0
    begun = {**reader.metadata, SALVAGE: UNFINISHED}
    with BagWriter(target, table, metadata=begun) as bag:
        for message in reader.messages():
            if message.topic not in table:
                continue
            bag.write_raw(message.topic, message.log_time_ns, message.cdr)
            recovered += 1
            progress(min(recovered, held), held)
        lost = max(reader.messages_lost, (reader.expected or 0) - recovered, held - recovered)
        # What was lost to an earlier interruption does not come back.
        in_part = reader.metadata.get(SALVAGE) == UNFINISHED
        bag.remark(SALVAGE, UNFINISHED if in_part else COMPLETE)
        bag.remark('salvaged_from', source.name)
        bag.remark('salvage_lost', str(lost))
        for number, notice in enumerate(reader.notices):
            bag.remark(f'salvage_notice_{number}', notice)
    return Salvage(bag=target, recovered=recovered, lost=lost, notices=reader.notices)
