"""Frames whose time stamp cannot be: far from the stamps on both sides.

Tested by ``test/recordings/test_stamp_check.py``.
"""

from __future__ import annotations

from typing import Generic, TypeVar

from nanorocks_ros.errors import FrameError
from nanorocks_ros.limits import PAUSE_SECONDS
from nanorocks_ros.records import NS

Item = TypeVar('Item')

# A stamp further from the last one waits for the next, [ns]: a camera that paused, a player that
# loops or seeks, or a stamp that is wrong.
_JUMP_NS = 5 * NS
_DAY_NS = 86_400 * NS


class StampCheck(Generic[Item]):
    """Refuses lone frames whose stamps are further from both neighbours than these from another.

    Frames are further apart than a recording ever pauses (`limits.PAUSE_SECONDS`) only where two
    in a row agree: then the clock of the camera was set. A frame that jumps is held back until
    the next one decides, and so is the first one.

    Parameters
    ----------
    where : str
        The camera, for errors.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._longest_ns = PAUSE_SECONDS.value * NS
        self._last_ns: int | None = None
        self._waiting: list[tuple[int, Item]] = []

    def push(self, stamp_ns: int, item: Item) -> list[tuple[Item, FrameError | None]]:
        """Check the next frame.

        Parameters
        ----------
        stamp_ns : int, [ns]
        item : object
            The frame, in any form.

        Returns
        -------
        list of (Item, FrameError or None)
            The items that this decides, in order, and why one is refused.
        """
        decided = self._decide_by(stamp_ns)
        near = self._last_ns is not None and abs(stamp_ns - self._last_ns) <= _JUMP_NS
        if near and not self._waiting:
            self._last_ns = stamp_ns
            decided.append((item, None))
        else:
            self._waiting.append((stamp_ns, item))
        return decided

    def release(self) -> list[tuple[Item, FrameError | None]]:
        """Decide on a frame after which none comes for now; one beyond the limit waits on."""
        if not self._waiting or not self._is_within_limit(self._waiting[0][0]):
            return []
        return self._decide(self._waiting[0][0])

    def end(self) -> list[tuple[Item, FrameError | None]]:
        """Decide on the last frames."""
        return self.release() or self._decide(None)

    def _is_within_limit(self, stamp_ns: int) -> bool:
        return self._last_ns is None or abs(stamp_ns - self._last_ns) <= self._longest_ns

    def _decide_by(self, next_ns: int) -> list[tuple[Item, FrameError | None]]:
        """Decide on the frames that wait, by the stamp of the next one."""
        if not self._waiting:
            return []
        # Of the first frames there may be two, which contradict each other.
        near_ns = min((stamp for stamp, _ in self._waiting), key=lambda s: abs(s - next_ns))
        away_ns = abs(near_ns - next_ns)
        if self._last_ns is not None and away_ns > abs(self._last_ns - next_ns):
            return self._decide(None)
        if away_ns <= self._longest_ns:
            return self._decide(near_ns)
        if self._last_ns is None and len(self._waiting) == 1:
            return []
        (stamp_ns, item), *self._waiting = self._waiting
        return [(item, self._impossible(stamp_ns, next_ns))]

    def _decide(self, possible_ns: int | None) -> list[tuple[Item, FrameError | None]]:
        """Pass on the frame that waits with this stamp, refuse others."""
        if possible_ns is not None:
            self._last_ns = possible_ns
        waiting, self._waiting = self._waiting, []
        return [
            (item, None if stamp_ns == possible_ns else self._impossible(stamp_ns, self._last_ns))
            for stamp_ns, item in waiting
        ]

    def _impossible(self, stamp_ns: int, near_ns: int | None) -> FrameError:
        away_ns = 0 if near_ns is None else abs(stamp_ns - near_ns)
        far = f'{away_ns // _DAY_NS} days' if away_ns > 2 * _DAY_NS else f'{away_ns // NS} s'
        return FrameError(
            self._where,
            f'a frame has the impossible time stamp {stamp_ns} ns, {far} from those beside it',
            'omit this frame; if the camera paused so long, set '
            f'{PAUSE_SECONDS.variable} to more seconds'
            if away_ns > self._longest_ns
            else 'check the clock of the camera; this frame is left out',
        )
