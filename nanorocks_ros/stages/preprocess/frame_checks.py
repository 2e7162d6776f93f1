"""Whether a frame can be used: black, white, frozen, stored twice, or only half of it there."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.quantiles import Quantile, median
from nanorocks_ros.records import Notice, Quality

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Frame

NS = 1_000_000_000
# Rows that are looked at, and pixels of them: a look at the whole frame costs as much as all else.
_ROW_STEP = 16
_COLUMN_STEP = 4
_BLACK, _WHITE = 4.0, 251.0
# A picture that stays the same for longer is not stored twice, it stands still.
_FROZEN_NS = NS // 4
_FROZEN_TOLD_NS = NS
# Compressed anew, a frame stored twice differs a little from itself: by less than such a share of
# what noise and motion change from frame to frame, where that is so many gray levels.
_RECODED, _NOISY = 0.1, 0.5
_USUAL = 0.75
# Filled rows that count, as a share of the height, beyond those that frames usually end in.
_HALF = 0.03
_FEWEST_ROWS = 12
_USUAL_FRAMES = 30
_HISTORY = 5
# Levels by which a filled row may differ from the next: JPEG leaves a little.
_FILLED = 2


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is to be done with a frame.

    Parameters
    ----------
    usable : bool
    rows : int, [px]
        Of the frame that can be used, from above.
    quality : Quality
        Flags for the images of all trays.
    notices : tuple of Notice
    """

    usable: bool
    rows: int
    quality: Quality
    notices: tuple[Notice, ...] = ()


class FrameChecks:
    """Looks at each frame before anything else does.

    Parameters
    ----------
    camera : str
        What to call the source of the frames.
    """

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self._sample: NDArray[np.uint8] | None = None
        self._image: NDArray[np.uint8] | None = None
        self._changes = Quantile(_USUAL, _USUAL_FRAMES)
        self._usual_change = 0.0
        self._known = 0
        self._changed_ns = 0
        self._ends: deque[int] = deque(maxlen=_USUAL_FRAMES)
        self._same: deque[int] = deque(maxlen=_USUAL_FRAMES)
        self._blank = 0
        self._told: set[str] = set()
        self._frozen_told = False
        self.duplicates = 0

    def push(self, frame: Frame) -> Verdict:
        """Judge the next frame; stamps rise."""
        sample = frame.image[_ROW_STEP // 2 :: _ROW_STEP, ::_COLUMN_STEP]
        sample = np.ascontiguousarray(sample)
        height = frame.image.shape[0]
        blank = self._blankness(sample)
        if blank:
            self._blank += 1
            text = f'the picture is {blank}; left out until it returns'
            told = (self._notice(frame, text),) if self._blank == 1 else ()
            return Verdict(False, height, Quality(0), told)
        notices = self._light_again(frame)
        if self._unchanged(frame, sample):
            return self._stands_still(frame, notices)
        rows = self._filled_from(frame)
        self._sample, self._image = sample, frame.image
        self._changed_ns, self._frozen_told = frame.stamp_ns, False
        colored = sample.ndim == 3 and _has_colors(sample)
        quality = Quality(0) if colored else Quality.GRAY_CAMERA
        if rows < height:
            text = (
                f'a frame breaks off at row {rows} of {height}; the trays below it are left out, '
                'here and whenever it happens'
            )
            notices = (*notices, *self._once(frame, 'half', text))
        return Verdict(True, rows, quality, notices)

    def _notice(self, frame: Frame, text: str) -> Notice:
        return Notice(stamp_ns=frame.stamp_ns, text=f'{self._camera}: {text}')

    def _once(self, frame: Frame, key: str, text: str) -> tuple[Notice, ...]:
        if key in self._told:
            return ()
        self._told.add(key)
        return (self._notice(frame, text),)

    def _blankness(self, sample: NDArray[np.uint8]) -> str:
        # Sums of whole numbers, and exact: `numpy.mean` turns each pixel into a float first.
        level = sum(cv2.sumElems(sample)) / sample.size
        if level < _BLACK:
            return f'black (mean level {level:.1f})'
        return f'white (mean level {level:.1f})' if level > _WHITE else ''

    def _light_again(self, frame: Frame) -> tuple[Notice, ...]:
        count, self._blank = self._blank, 0
        if not count:
            return ()
        return (self._notice(frame, f'the picture is back; {count} blank frames were left out'),)

    def _unchanged(self, frame: Frame, sample: NDArray[np.uint8]) -> bool:
        if self._image is None or self._sample is None:
            return False
        change = float(cv2.norm(sample, self._sample, cv2.NORM_L1)) / sample.size
        if change == 0.0:
            # The whole frame is compared only where its sample is the same.
            return np.array_equal(frame.image, self._image)
        # Until copies are known as such, they are half of what is seen.
        usual = self._usual_change if self._known >= _HISTORY else 0.0
        if usual >= _NOISY and change <= _RECODED * usual:
            return True
        self._usual_change = self._changes.push(change)
        self._known += 1
        return False

    def _stands_still(self, frame: Frame, notices: tuple[Notice, ...]) -> Verdict:
        rows = frame.image.shape[0]
        still_ns = frame.stamp_ns - self._changed_ns
        if still_ns < _FROZEN_NS:
            self.duplicates += 1
            text = (
                'a frame is the same as the one before it; such frames are left out, here and '
                'whenever it happens'
            )
            notices = (*notices, *self._once(frame, 'duplicate', text))
            return Verdict(False, rows, Quality(0), notices)
        if still_ns >= _FROZEN_TOLD_NS and not self._frozen_told:
            self._frozen_told = True
            text = f'the picture has stood still for {still_ns / NS:.1f} s; check the camera'
            notices = (*notices, self._notice(frame, text))
        return Verdict(True, rows, Quality.FROZEN, notices)

    def _filled_from(self, frame: Frame) -> int:
        """The row from which on the frame holds nothing new, or its height."""
        height = frame.image.shape[0]
        image = frame.image.reshape(height, frame.image.shape[1], -1)
        filled = _filled_rows(image)
        same = 0
        if self._image is not None and self._image.shape == frame.image.shape:
            same = _rows_the_same(image, self._image.reshape(image.shape))
        cut, least = 0, max(_FEWEST_ROWS, _HALF * height)
        for count, usual, history in ((filled, self._ends, 1), (same, self._same, _HISTORY)):
            # A scene without noise may well end in rows that are alike, frame after frame.
            if count >= least and len(usual) >= history and count - median(usual) >= least:
                cut = max(cut, count)
            usual.append(count)
        return int(height - cut)


@compiled
def _has_colors(sample: NDArray[np.uint8]) -> bool:
    for i in range(sample.shape[0]):
        for j in range(sample.shape[1]):
            if sample[i, j, 0] != sample[i, j, 1] or sample[i, j, 0] != sample[i, j, 2]:
                return True
    return False


@compiled
def _filled_rows(image: NDArray[np.uint8]) -> int:
    """Rows at the lower end that are alike, as where a picture broke off; 0 when all are."""
    rows, columns, channels = image.shape
    for count in range(1, rows):
        for j in range(0, columns, _COLUMN_STEP):
            for channel in range(channels):
                other = np.int64(image[rows - 1 - count, j, channel])
                if abs(other - np.int64(image[rows - 1, j, channel])) > _FILLED:
                    return count
    return 0


@compiled
def _rows_the_same(image: NDArray[np.uint8], before: NDArray[np.uint8]) -> int:
    """Rows at the lower end that are those of the frame before, to the last bit."""
    rows, columns, channels = image.shape
    for count in range(rows):
        for j in range(columns):
            for channel in range(channels):
                if image[rows - 1 - count, j, channel] != before[rows - 1 - count, j, channel]:
                    return count
    return int(rows)
