"""Pictures that a film holds twice: to the last bit, or but for what compression changed.

Drawn pictures are compared by their brightness alone.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import cv2

from nanorocks_ros.recordings.film.film_source import NS, StoredPicture

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.recordings.film.film_source import DrawnPicture, Shot
    from nanorocks_ros.recordings.film.timestamp_repair import Stamped

# A picture that stays the same for so long is kept once in that time: it may stand still.
_STILL_NS = NS
# Repeats in a row that are known as such although compression changed them a little.
_LONGEST_RUN = 7
# Compressed anew, a repeat differs from what it repeats by less than such shares of what pictures
# around it differ by, which is so many levels at least where they differ most: on average, where
# it differs most, and the product of both. Of 5 codecs at usual qualities it reaches 0.13.
_SHARE, _PRODUCT, _MOST = 0.5, 0.15, 6.0
# JPEGs are compared by more than their bytes in the beginning, and on if there were repeats.
_DECODED = 64
_BLOCK_PX = 8
# Where something swings, pictures at its turning points repeat each other as well. Those around
# them do, too: they differ by less than this share of what they differ from these by.
_TURNED = 0.8


class _Change(NamedTuple):
    """How a picture differs from the one before it: on average, and most, [gray levels]."""

    mean: float
    most: float

    def is_small_beside(self, other: _Change) -> bool:
        if other.most < _MOST:
            return False
        mean, most = self.mean / other.mean, self.most / other.most
        return max(mean, most) <= _SHARE and mean * most <= _PRODUCT


_NONE = _Change(0.0, 0.0)


class Repeats:
    """Leaves out pictures that the film holds twice.

    Attributes
    ----------
    dropped : int
        Pictures left out, so far.
    still_ns : int, [ns]
        The longest time over which the picture stayed the same, to the last bit.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self.still_ns = 0
        self._run: list[tuple[Stamped[Shot], _Change]] = []
        self._before: _Change | None = None
        self._any_run = False
        self._compared = 0
        # Runs between pictures that are alike, and between others.
        self._turned = self._straight = 0
        # Of the last pictures, and of that before the one that a run repeats.
        self._grays: deque[NDArray[np.uint8]] = deque(maxlen=3)
        self._gray_ahead: NDArray[np.uint8] | None = None

    def without(self, shots: Iterable[Stamped[Shot]]) -> Iterator[Stamped[Shot]]:
        """The pictures that are held once, as soon as those behind them are known.

        Parameters
        ----------
        shots : iterable of Stamped
            Stamps rise.

        Yields
        ------
        Stamped
        """
        previous: Stamped[Shot] | None = None
        since_ns = kept_ns = 0
        for shot in shots:
            change = (
                None
                if previous is None
                else self._change(previous.item.picture, shot.item.picture)
            )
            if change == _NONE:
                self.still_ns = max(self.still_ns, shot.stamp_ns - since_ns)
                if shot.stamp_ns - kept_ns < _STILL_NS:
                    self.dropped += 1
                    continue
                yield from self._release()
                yield shot
            elif change is None:
                yield from self._release()
                yield shot
            else:
                since_ns = shot.stamp_ns
                yield from self._judged(shot, change)
            kept_ns = shot.stamp_ns
            if previous is None:
                since_ns = shot.stamp_ns
            previous = shot
        yield from self._end()

    def _change(
        self, before: StoredPicture | DrawnPicture, now: StoredPicture | DrawnPicture
    ) -> _Change | None:
        """How two pictures differ; None when they do and it is not known by how much."""
        if isinstance(now, StoredPicture):
            if before == now:
                return _NONE
            if self._compared >= _DECODED and not self._any_run:
                self._grays.clear()
                return None
        self._compared += 1
        if not self._grays:
            self._grays.append(before.gray())
        self._grays.append(now.gray())
        return _difference(self._grays[-2], self._grays[-1])

    def _judged(self, shot: Stamped[Shot], change: _Change) -> Iterator[Stamped[Shot]]:
        """Pictures that differ little wait for one that differs more, as the one before did."""
        if self._run:
            if all(own.is_small_beside(change) for _, own in self._run):
                if self._may_have_turned(change):
                    yield from self._release()
                else:
                    self._drop()
                self._before = change
                yield shot
                return
            if self._is_candidate(change) and len(self._run) < _LONGEST_RUN:
                self._run.append((shot, change))
                return
            yield from self._release()
        if self._before is None or self._is_candidate(change):
            self._run.append((shot, change))
            self._gray_ahead = self._grays[0] if len(self._grays) == 3 else None
            return
        self._before = change
        yield shot

    def _is_candidate(self, change: _Change) -> bool:
        return self._before is not None and change.is_small_beside(self._before)

    def _may_have_turned(self, after: _Change) -> bool:
        """Whether the pictures around a run are alike, as around most runs so far."""
        if self._gray_ahead is None or self._before is None:
            return False
        around = _difference(self._gray_ahead, self._grays[-1])
        least = min(self._before.mean, after.mean)
        turned = around is not None and around.mean < _TURNED * least
        self._turned += turned
        self._straight += not turned
        return turned and self._turned > 2 * self._straight

    def _drop(self) -> None:
        self.dropped += len(self._run)
        # Of the first pictures nothing tells whether they turned.
        self._any_run = self._any_run or self._before is not None
        self._run.clear()

    def _release(self) -> Iterator[Stamped[Shot]]:
        if self._run:
            self._before = self._run[-1][1]
        yield from [one for one, _ in self._run]
        self._run.clear()

    def _end(self) -> Iterator[Stamped[Shot]]:
        """At the end nothing follows that differs more; what held before holds there."""
        if self._any_run and self._run and self._before is not None:
            self._drop()
        yield from self._release()


def _difference(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> _Change | None:
    if one.shape != other.shape or not one.size:
        return None
    difference = cv2.absdiff(one, other)
    total = cv2.norm(difference, cv2.NORM_L1)
    if not total:
        return _NONE
    height, width = (max(1, side // _BLOCK_PX) for side in difference.shape)
    blocks = cv2.resize(difference, (width, height), interpolation=cv2.INTER_AREA)
    return _Change(total / difference.size, float(blocks.max()))
