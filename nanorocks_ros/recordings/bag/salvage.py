"""Copy the readable messages of a damaged recording into a new one."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.provenance import COMPLETE, SALVAGE, UNFINISHED
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.offered_qos import OfferedQos

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class SalvageResult:
    """Result of a salvage.

    Parameters
    ----------
    bag : Path
        The new recording.
    recovered : int
        Number of messages in the new recording.
    lost : int
        Number of messages known to be lost; those behind a truncation are included only if the
        recorder counted them.
    notices : tuple of str
        Damage of the source, in sentences.
    """

    bag: Path
    recovered: int
    lost: int
    notices: tuple[str, ...]


def salvage(source: Path, target: Path, progress: Callable[[int, int], None]) -> SalvageResult:
    """Copy every readable message into a new recording; the source is not changed.

    If the copy is interrupted, the new recording contains the messages written until then and is
    marked as unfinished.

    Parameters
    ----------
    source : Path
        Damaged, truncated, or without ``metadata.yaml``; MCAP or SQLite.
    target : Path
        Must not exist.
    progress : callable
        Called with the number of copied messages and the expected total.

    Returns
    -------
    SalvageResult

    Raises
    ------
    RecordingError
        If there is nothing to salvage, or the new recording cannot be written.
    """
    if os.path.lexists(target):
        raise RecordingError(
            str(target), 'exists already and is not overwritten', 'pass another path'
        )
    reader = open_bag(source, salvaging=True)
    total = sum(info.count for info in reader.topics.values())
    if not total:
        raise RecordingError(
            str(source), 'holds no message that can be recovered', 'look for another copy of it'
        )
    topics = {
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
    metadata = {**reader.metadata, SALVAGE: UNFINISHED}
    with BagWriter(target, topics, metadata=metadata) as bag:
        for message in reader.messages():
            if message.topic not in topics:
                continue
            bag.write_raw(message.topic, message.log_time_ns, message.cdr)
            recovered += 1
            progress(min(recovered, total), total)
        lost = max(reader.messages_lost, (reader.expected or 0) - recovered, total - recovered)
        # A copy of an unfinished salvage is unfinished, too.
        source_unfinished = reader.metadata.get(SALVAGE) == UNFINISHED
        bag.set_metadata(SALVAGE, UNFINISHED if source_unfinished else COMPLETE)
        bag.set_metadata('salvaged_from', source.name)
        bag.set_metadata('salvage_lost', str(lost))
        for number, notice in enumerate(reader.notices):
            bag.set_metadata(f'salvage_notice_{number}', notice)
    return SalvageResult(bag=target, recovered=recovered, lost=lost, notices=reader.notices)
