"""Checks of a frame: black, white, frozen, stored twice or incomplete."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.picture_shift import is_shifted, repeats_often, shifted_share
from nanorocks_ros.numerics.quantiles import Quantile, median
from nanorocks_ros.records import NS, Notice, Quality

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Frame

# Steps of the sample of rows and columns: the whole frame would cost as much as all other work.
_ROW_STEP = 16
_COLUMN_STEP = 4
_BLACK, _WHITE = 4.0, 251.0
# A picture that stays the same for longer is frozen, not stored twice.
_FROZEN_NS = NS // 4
_FROZEN_NOTICE_NS = NS
# A duplicate that was compressed again differs a little: by less than this share of the usual
# change from frame to frame, where that is so many gray levels.
_RECODED, _NOISY = 0.1, 0.5
# Below this share, a codec found nothing new, and may shift what it had drawn coarsely: where that
# happens often, pictures are repeated.
_SKIPPED = 0.05
_USUAL = 0.75
# Smallest number of filled rows, as a share of the height, beyond the usual number.
_HALF = 0.03
_FEWEST_ROWS = 12
_USUAL_FRAMES = 30
_HISTORY = 5
# Rows that stay the same hide something where, so many pixels below the first of them, blocks of
# 16 pixels changed from frame to frame so far: a codec skips what is still, and a bead that leaves
# these rows is not farther away after one frame. Key frames change still blocks by less than
# so many gray levels, and only once.
_BLOCK_PX = 16
_DEPTH_PX = 32
_MOVED = 3.0
_CHANGES = 2
# Frames after which a part that stays the same is no longer compared with what moved there before.
_MOST_BROKEN = 15
# Largest difference of levels between filled rows, due to JPEG.
_FILLED = 2


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of the checks of a frame.

    Parameters
    ----------
    usable : bool
    rows : int, [px]
        Usable rows of the frame, from above.
    quality : Quality
        Flags for the images of all trays.
    notices : tuple of Notice
    """

    usable: bool
    rows: int
    quality: Quality
    notices: tuple[Notice, ...] = ()


class FrameChecks:
    """Checks each frame before all other stages.

    Parameters
    ----------
    camera : str
        Name of the source of the frames in notices.
    """

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self._sample: NDArray[np.uint8] | None = None
        self._image: NDArray[np.uint8] | None = None
        self._changes = Quantile(_USUAL, _USUAL_FRAMES)
        self._usual_change = 0.0
        self._changed_frames = 0
        self._skipped = 0
        self._changed_ns = 0
        self._ends: deque[int] = deque(maxlen=_USUAL_FRAMES)
        self._whole: deque[NDArray[np.uint8]] = deque(maxlen=_CHANGES + 1)
        self._broken = 0
        self._blank = 0
        self._noticed: set[str] = set()
        self._frozen_noticed = False
        self.duplicates = 0

    def push(self, frame: Frame) -> Verdict:
        """Check the next frame; stamps must rise."""
        sample = frame.image[_ROW_STEP // 2 :: _ROW_STEP, ::_COLUMN_STEP]
        sample = np.ascontiguousarray(sample)
        height = frame.image.shape[0]
        blank = self._blankness(sample)
        if blank:
            self._blank += 1
            text = f'the picture is {blank}; left out until it returns'
            first = (self._notice(frame, text),) if self._blank == 1 else ()
            return Verdict(False, height, Quality(0), first)
        notices = self._end_of_blank(frame)
        if self._unchanged(frame, sample):
            return self._frozen(frame, notices)
        rows = self._filled_from(frame)
        self._sample, self._image = sample, frame.image
        self._changed_ns, self._frozen_noticed = frame.stamp_ns, False
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
        if key in self._noticed:
            return ()
        self._noticed.add(key)
        return (self._notice(frame, text),)

    def _blankness(self, sample: NDArray[np.uint8]) -> str:
        # Exact sums of integers: `numpy.mean` would convert each pixel to a float first.
        level = sum(cv2.sumElems(sample)) / sample.size
        if level < _BLACK:
            return f'black (mean level {level:.1f})'
        return f'white (mean level {level:.1f})' if level > _WHITE else ''

    def _end_of_blank(self, frame: Frame) -> tuple[Notice, ...]:
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
        # At first half of all frames may be duplicates.
        usual = self._usual_change if self._changed_frames >= _HISTORY else 0.0
        if usual >= _NOISY and change <= _RECODED * usual:
            share = shifted_share(_one_channel(self._image), _one_channel(frame.image))
            skipped = change <= _SKIPPED * usual
            self._skipped += skipped
            frames = self._changed_frames + self.duplicates
            often = repeats_often(max(self._skipped, self.duplicates), frames)
            if not is_shifted(share) or (skipped and often):
                return True
        self._usual_change = self._changes.push(change)
        self._changed_frames += 1
        return False

    def _frozen(self, frame: Frame, notices: tuple[Notice, ...]) -> Verdict:
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
        if still_ns >= _FROZEN_NOTICE_NS and not self._frozen_noticed:
            self._frozen_noticed = True
            text = f'the picture has stood still for {still_ns / NS:.1f} s; check the camera'
            notices = (*notices, self._notice(frame, text))
        return Verdict(True, rows, Quality.FROZEN, notices)

    def _filled_from(self, frame: Frame) -> int:
        """The first row of the incomplete part of the frame, or its height."""
        height = frame.image.shape[0]
        image = frame.image.reshape(height, frame.image.shape[1], -1)
        smallest = max(_FEWEST_ROWS, _HALF * height)
        filled = _filled_rows(image)
        # A scene without noise may end in equal rows in every frame.
        beyond = filled - median(self._ends) if self._ends else 0
        self._ends.append(filled)
        cut = filled if beyond >= smallest and self._differs(image, height - filled) else 0
        if self._image is not None and self._image.shape == frame.image.shape:
            same = _rows_the_same(image, self._image.reshape(image.shape))
            if same >= max(smallest, cut + 1) and self._hides_motion(height - same + _DEPTH_PX):
                cut = same
        self._broken = self._broken + 1 if cut else 0
        if not 0 < self._broken <= _MOST_BROKEN:
            self._whole.append(image)
        return int(height - cut)

    def _differs(self, image: NDArray[np.uint8], row: int) -> bool:
        """Whether the rows from one on differ from those of the last whole frame."""
        if not self._whole or self._whole[-1].shape != image.shape:
            return True
        return _largest_change(image[row:], self._whole[-1][row:]) > _MOVED

    def _hides_motion(self, row: int) -> bool:
        """Whether something moved from one row on, in each of the last whole frames."""
        pairs = list(pairwise(self._whole))
        return (
            len(pairs) == _CHANGES
            and row < self._whole[-1].shape[0]
            and all(
                before.shape == now.shape and _largest_change(now[row:], before[row:]) > _MOVED
                for before, now in pairs
            )
        )


def _one_channel(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture itself, or its middle channel."""
    return image if image.ndim == 2 else image[..., image.shape[2] // 2]


def _largest_change(now: NDArray[np.uint8], before: NDArray[np.uint8]) -> float:
    """Largest mean difference of a block of two pictures, [gray levels]."""
    difference = cv2.absdiff(_one_channel(now), _one_channel(before))
    size = [max(1, side // _BLOCK_PX) for side in difference.shape]
    return float(cv2.resize(difference, size[::-1], interpolation=cv2.INTER_AREA).max())


@compiled
def _has_colors(sample: NDArray[np.uint8]) -> bool:
    for i in range(sample.shape[0]):
        for j in range(sample.shape[1]):
            if sample[i, j, 0] != sample[i, j, 1] or sample[i, j, 0] != sample[i, j, 2]:
                return True
    return False


@compiled
def _filled_rows(image: NDArray[np.uint8]) -> int:
    """Number of equal rows at the lower end, as in an incomplete picture; 0 when all are equal."""
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
    """Number of rows at the lower end that equal those of the frame before."""
    rows, columns, channels = image.shape
    for count in range(rows):
        for j in range(columns):
            for channel in range(channels):
                if image[rows - 1 - count, j, channel] != before[rows - 1 - count, j, channel]:
                    return count
    return int(rows)
