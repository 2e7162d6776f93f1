"""Removal of duplicate frames: identical ones, and those that differ only by compression noise.

Decoded frames are compared by their brightness.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import cv2

from nanorocks_ros.numerics.picture_shift import is_shifted, repeats_often, shifted_share
from nanorocks_ros.recordings.film.film_source import EncodedImage
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.recordings.film.film_source import DecodedImage, FilmFrame
    from nanorocks_ros.recordings.film.timestamp_repair import Stamped

# Of identical frames, one is kept in each such time: the picture may stand still.
_STILL_NS = NS
# Largest number of consecutive duplicates that differ by compression noise.
_LONGEST_RUN = 7
# A recompressed duplicate differs from its original less than neighbouring frames differ from each
# other: the ratios of the mean and of the largest difference are at most _MAX_RATIO, their product
# at most _MAX_PRODUCT. Neighbouring frames must differ by at least _MIN_CHANGE gray levels.
# With 5 codecs at usual qualities the product reaches 0.13.
_MAX_RATIO, _MAX_PRODUCT, _MIN_CHANGE = 0.5, 0.15, 6.0
# A codec that finds nothing new changes a picture by so little (0.009 at most with x264 and
# MPEG-4) that a shift means nothing: it refines what it had drawn coarsely. When a camera that
# jitters returns to its place, the beads change the picture more (0.02).
_SKIPPED_PRODUCT = 0.01
# Stored images are decoded for the comparison only among the first frames, and later only if there
# were duplicates among those.
_DECODED_FRAMES = 64
_BLOCK_PX = 8
# At the turning points of an oscillation frames are alike, and so are the frames around them: they
# differ by less than this ratio of their difference to the frames at the turning point.
_TURNING_RATIO = 0.8


class _Change(NamedTuple):
    """Difference of a frame from the previous one: mean and maximum, [gray levels].

    `shifted`: share of it that is motion, where it was measured. A camera that shakes returns to
    the same place now and then, while the beads have moved.
    """

    mean: float
    maximum: float
    shifted: float = 0.0

    def is_small_beside(self, other: _Change, often: bool) -> bool:
        """Whether another picture would have changed more; `often`: as many frames as repeats."""
        if other.maximum < _MIN_CHANGE:
            return False
        mean, maximum = self.mean / other.mean, self.maximum / other.maximum
        if max(mean, maximum) > _MAX_RATIO or mean * maximum > _MAX_PRODUCT:
            return False
        skipped = mean * maximum <= _SKIPPED_PRODUCT
        return (skipped and often) or not is_shifted(self.shifted)

    def is_skipped_beside(self, other: _Change) -> bool:
        product = self.mean * self.maximum
        return product <= _SKIPPED_PRODUCT * other.mean * other.maximum


_NONE = _Change(0.0, 0.0)


class DuplicateFilter:
    """Remove duplicate frames.

    Attributes
    ----------
    dropped : int
        Number of removed frames so far.
    still_ns : int, [ns]
        Longest time over which the frames were identical.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self.still_ns = 0
        # Candidates for duplicates, which wait for a larger change.
        self._run: list[tuple[Stamped[FilmFrame], _Change]] = []
        self._before: _Change | None = None
        self._any_run = False
        self._compared = 0
        # Number of runs at turning points of an oscillation, and of other runs.
        self._turning_runs = self._other_runs = 0
        # Number of frames compared, and of those in which a codec found hardly anything new.
        self._judgements = self._skipped = 0
        # Brightness of the last frames, and of the frame before the original of a run.
        self._grays: deque[NDArray[np.uint8]] = deque(maxlen=3)
        self._gray_ahead: NDArray[np.uint8] | None = None

    def filter(self, frames: Iterable[Stamped[FilmFrame]]) -> Iterator[Stamped[FilmFrame]]:
        """Yield each distinct frame as soon as the frames behind it are known.

        Parameters
        ----------
        frames : iterable of Stamped
            Stamps rise.

        Yields
        ------
        Stamped
        """
        previous: Stamped[FilmFrame] | None = None
        since_ns = kept_ns = 0
        for frame in frames:
            change = (
                None
                if previous is None
                else self._change(previous.item.picture, frame.item.picture)
            )
            if change == _NONE:
                self.still_ns = max(self.still_ns, frame.stamp_ns - since_ns)
                if frame.stamp_ns - kept_ns < _STILL_NS:
                    self._judgements += 1
                    self.dropped += 1
                    continue
                yield from self._release()
                yield frame
            elif change is None:
                yield from self._release()
                yield frame
            else:
                since_ns = frame.stamp_ns
                yield from self._judged(frame, change)
            kept_ns = frame.stamp_ns
            if previous is None:
                since_ns = frame.stamp_ns
            previous = frame
        yield from self._end()

    def _change(
        self, before: EncodedImage | DecodedImage, now: EncodedImage | DecodedImage
    ) -> _Change | None:
        """Difference of two images; None if they differ by an unknown amount."""
        if isinstance(now, EncodedImage):
            if before == now:
                return _NONE
            if self._compared >= _DECODED_FRAMES and not self._any_run:
                self._grays.clear()
                return None
        self._compared += 1
        if not self._grays:
            self._grays.append(before.gray())
        self._grays.append(now.gray())
        return _difference(self._grays[-2], self._grays[-1])

    def _judged(self, frame: Stamped[FilmFrame], change: _Change) -> Iterator[Stamped[FilmFrame]]:
        """Hold back frames with a small change until a larger change follows."""
        self._judgements += 1
        if self._before is None or self._is_candidate(change):
            change = change._replace(shifted=shifted_share(self._grays[-2], self._grays[-1]))
            self._skipped += self._before is not None and change.is_skipped_beside(self._before)
        if self._run:
            if all(small.is_small_beside(change, self._often) for _, small in self._run):
                if self._is_turning_point(change):
                    yield from self._release()
                else:
                    self._drop()
                self._before = change
                yield frame
                return
            if self._is_candidate(change) and len(self._run) < _LONGEST_RUN:
                self._run.append((frame, change))
                return
            yield from self._release()
        if self._before is None or self._is_candidate(change):
            self._run.append((frame, change))
            self._gray_ahead = self._grays[0] if len(self._grays) == 3 else None
            return
        self._before = change
        yield frame

    def _is_candidate(self, change: _Change) -> bool:
        return self._before is not None and change.is_small_beside(self._before, self._often)

    @property
    def _often(self) -> bool:
        return repeats_often(max(self._skipped, self.dropped), self._judgements)

    def _is_turning_point(self, after: _Change) -> bool:
        """Whether the frames around a run are alike, as around most runs so far."""
        if self._gray_ahead is None or self._before is None:
            return False
        around = _difference(self._gray_ahead, self._grays[-1])
        smallest = min(self._before.mean, after.mean)
        turning = around is not None and around.mean < _TURNING_RATIO * smallest
        self._turning_runs += turning
        self._other_runs += not turning
        return turning and self._turning_runs > 2 * self._other_runs

    def _drop(self) -> None:
        self.dropped += len(self._run)
        # A run at the first frames may be a turning point; it is no evidence of duplicates.
        self._any_run = self._any_run or self._before is not None
        self._run.clear()

    def _release(self) -> Iterator[Stamped[FilmFrame]]:
        if self._run:
            self._before = self._run[-1][1]
        yield from [frame for frame, _ in self._run]
        self._run.clear()

    def _end(self) -> Iterator[Stamped[FilmFrame]]:
        """Drop the last run if there were duplicates before, else yield it."""
        if self._any_run and self._run and self._before is not None:
            self._drop()
        yield from self._release()


def _difference(before: NDArray[np.uint8], now: NDArray[np.uint8]) -> _Change | None:
    """Difference of two gray images; None if their sizes differ or they are empty."""
    if before.shape != now.shape or not before.size:
        return None
    difference = cv2.absdiff(before, now)
    total = cv2.norm(difference, cv2.NORM_L1)
    if not total:
        return _NONE
    height, width = (max(1, side // _BLOCK_PX) for side in difference.shape)
    blocks = cv2.resize(difference, (width, height), interpolation=cv2.INTER_AREA)
    return _Change(total / difference.size, float(blocks.max()))
