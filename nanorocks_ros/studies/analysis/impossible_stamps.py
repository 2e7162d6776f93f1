"""Frames whose time stamp cannot be: far from the stamps on both sides."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import TYPE_CHECKING

from nanorocks_ros.errors import FrameError
from nanorocks_ros.limits import PAUSE_SECONDS
from nanorocks_ros.records import NS, Frame

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_AHEAD = 2


def with_possible_stamps(
    frames: Iterable[Frame | FrameError], where: str
) -> Iterator[Frame | FrameError]:
    """Replace frames whose stamps cannot be by the reason.

    A stamp is impossible if it is further from its neighbours than a recording ever pauses
    (`limits.PAUSE_SECONDS`). Two such frames in a row that agree are a camera whose clock was
    set: they are kept.

    Parameters
    ----------
    frames : iterable of Frame or FrameError
        In the order in which they were recorded.
    where : str
        The camera, for errors.

    Yields
    ------
    Frame or FrameError
        As many as were given.
    """
    longest_ns = PAUSE_SECONDS.value * NS
    source = iter(frames)
    waiting: deque[Frame | FrameError] = deque(islice(source, _AHEAD))
    last_ns: int | None = None
    while waiting:
        waiting.extend(islice(source, 1))
        frame = waiting.popleft()
        if isinstance(frame, FrameError):
            yield frame
            continue
        ahead = [item.stamp_ns for item in waiting if isinstance(item, Frame)]
        if _is_possible(frame.stamp_ns, last_ns, ahead, longest_ns):
            last_ns = frame.stamp_ns
            yield frame
        else:
            yield _impossible(frame, ahead[0] if last_ns is None else last_ns, where)


def _is_possible(stamp_ns: int, last_ns: int | None, ahead: list[int], longest_ns: int) -> bool:
    if last_ns is not None and abs(stamp_ns - last_ns) <= longest_ns:
        return True
    if ahead and abs(stamp_ns - ahead[0]) <= longest_ns:
        return True
    if last_ns is None:
        # The first frame: the next ones decide, if they agree.
        return len(ahead) < _AHEAD or abs(ahead[0] - ahead[1]) > longest_ns
    return False


def _impossible(frame: Frame, near_ns: int, where: str) -> FrameError:
    days = abs(frame.stamp_ns - near_ns) / NS / 86_400
    return FrameError(
        where,
        f'a frame has the impossible time stamp {frame.stamp_ns} ns, {days:.0f} days from those '
        'beside it',
        f'omit this frame; if the camera paused so long, set {PAUSE_SECONDS.variable} to more '
        'seconds',
    )
