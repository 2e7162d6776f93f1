"""Time range of a recording that is played, and the latched messages at its start."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Collection

    from nanorocks_ros.recordings.bag.reader import BagMessage, BagReader

# Length of the first time range searched for latched messages; each further one is four times
# as long.
_LOOK_BACK_NS = NS


def played_range(reader: BagReader, start: float, duration: float) -> tuple[int, int]:
    """First and last log time of the part that is played.

    Parameters
    ----------
    reader : BagReader
    start : float, [s], >= 0
        Since the first message.
    duration : float, [s], >= 0
        0: to the end of the recording.

    Returns
    -------
    tuple of int, [ns]

    Raises
    ------
    ConfigurationError
        If the recording ends before `start`.
    """
    start_ns = reader.start_ns + round(start * NS)
    if start_ns > reader.end_ns:
        length = (reader.end_ns - reader.start_ns) / NS
        raise ConfigurationError(
            'parameter start',
            f'{start:g} s, but {reader.path} has {length:.3f} s',
            'give a smaller value',
        )
    if duration <= 0.0:
        return start_ns, reader.end_ns
    return start_ns, min(reader.end_ns, start_ns + round(duration * NS) - 1)


def latched_messages(
    reader: BagReader, topics: Collection[str], stamp_ns: int
) -> list[BagMessage]:
    """Last message of each topic before a log time, as a latched topic would send it.

    Parameters
    ----------
    reader : BagReader
    topics : collection of str
    stamp_ns : int, [ns]
        Log time; messages at exactly this time are not included.

    Returns
    -------
    list of BagMessage
        In order of log time; topics without an earlier message are omitted.
    """
    messages: dict[str, BagMessage] = {}
    missing = set(topics)
    end_ns, step_ns = stamp_ns - 1, _LOOK_BACK_NS
    while missing and end_ns >= reader.start_ns:
        start_ns = max(end_ns - step_ns, reader.start_ns)
        messages.update(
            {message.topic: message for message in reader.messages(missing, start_ns, end_ns)}
        )
        missing -= messages.keys()
        end_ns, step_ns = start_ns - 1, 4 * step_ns
    return sorted(messages.values(), key=lambda message: message.log_time_ns)
