"""Which part of a recording is played, and what has to be told in the middle of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Collection

    from nanorocks_ros.recordings.bag.reader import BagMessage, BagReader

NS = 1_000_000_000
# How far back the last message of a topic is looked for at first; then four times as far.
_LOOK_BACK_NS = NS


def played_part(reader: BagReader, start: float, duration: float) -> tuple[int, int]:
    """First and last log time of what is played.

    Parameters
    ----------
    reader : BagReader
    start : float, [s], >= 0
        Since the first message.
    duration : float, [s], >= 0
        0: to the end.

    Returns
    -------
    tuple of int, [ns]

    Raises
    ------
    ConfigurationError
        When the recording is over before `start`.
    """
    start_ns = reader.start_ns + round(start * NS)
    if start_ns > reader.end_ns:
        length = (reader.end_ns - reader.start_ns) / NS
        raise ConfigurationError(
            'parameter start', f'{start:g} s, but {reader.path} has {length:.3f} s', 'give less'
        )
    if duration <= 0.0:
        return start_ns, reader.end_ns
    return start_ns, min(reader.end_ns, start_ns + round(duration * NS) - 1)


def latest(reader: BagReader, topics: Collection[str], stamp_ns: int) -> list[BagMessage]:
    """The last message of each topic before a time: what a latched topic would hold then.

    Parameters
    ----------
    reader : BagReader
    topics : collection of str
    stamp_ns : int, [ns]
        Log time; messages of this very time do not count.

    Returns
    -------
    list of BagMessage
        In order of log time; topics without a message before are left out.
    """
    messages: dict[str, BagMessage] = {}
    wanted = set(topics)
    end_ns, step_ns = stamp_ns - 1, _LOOK_BACK_NS
    while wanted and end_ns >= reader.start_ns:
        start_ns = max(end_ns - step_ns, reader.start_ns)
        messages.update(
            {message.topic: message for message in reader.messages(wanted, start_ns, end_ns)}
        )
        wanted -= messages.keys()
        end_ns, step_ns = start_ns - 1, 4 * step_ns
    return sorted(messages.values(), key=lambda one: one.log_time_ns)
