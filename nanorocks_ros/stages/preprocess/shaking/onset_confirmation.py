"""Confirmation of an onset of motion by the frames that follow it.

Tested by ``test/stages/preprocess/shaking/test_shake_detection.py``.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.shaking.difference_noise import MEMORY_FRAMES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# A step in time so many times longer than usual means that frames are missing.
_GAP = 1.75
# Frames after a jump that confirm it. In 0.3 s a bead of 3 mm/s moves by its radius; codecs settle
# within a few frames; publishers keep 30 images.
_CONFIRMATION_NS = 3 * NS // 10
_FEWEST_FRAMES, _MOST_FRAMES = 5, 24
# A candidate whose frames do not come is decided after this time.
_LONGEST_NS = NS


class Onsets(NamedTuple):
    """Beginnings of motion, each as the stamp of the last frame before it, [ns].

    Parameters
    ----------
    confirmed : tuple of int
        Those that the last frame confirmed.
    pending : tuple of int
        Candidates that later frames will decide.
    """

    confirmed: tuple[int, ...] = ()
    pending: tuple[int, ...] = ()


@dataclass(slots=True)
class Candidate:
    """A jump of the motion and what followed.

    Parameters
    ----------
    before_ns : int
        Stamp of the last frame before the jump.
    bar : float
        Motion that counts as lasting.
    frames : int
        Frames that decide.
    gray : ndarray of uint8, optional
        First image of the motion.
    motions : list of float
        Of the frames since.
    """

    before_ns: int
    bar: float
    frames: int
    gray: NDArray[np.uint8] | None = None
    motions: list[float] = field(default_factory=list)

    def lacking(self) -> int:
        """Frames without the motion so far."""
        return sum(motion <= self.bar for motion in self.motions)


class FrameClock:
    """Steps in time between frames, and how many frames confirm an onset."""

    def __init__(self) -> None:
        self._steps: deque[int] = deque(maxlen=MEMORY_FRAMES)
        self.last_ns: int | None = None
        self.previous_ns = 0

    def push(self, stamp_ns: int) -> bool:
        """Take the next stamp; False when it is the first or frames are missing before it."""
        last, self.last_ns = self.last_ns, stamp_ns
        if last is None:
            return False
        self.previous_ns = last
        step = stamp_ns - last
        usual = median(self._steps) if self._steps else step
        self._steps.append(step)
        return step <= _GAP * usual

    def confirming_frames(self) -> int:
        """Frames after a jump that confirm it."""
        frames = round(_CONFIRMATION_NS / max(1.0, median(self._steps)))
        return min(max(frames, _FEWEST_FRAMES), _MOST_FRAMES)


class Candidates:
    """The undecided jumps of a motion; `lacking`: share of the frames that may lack it."""

    def __init__(self, lacking: float) -> None:
        self._lacking = lacking
        self.undecided: list[Candidate] = []

    def add(self, candidate: Candidate) -> None:
        """Open a candidate, unless it only continues the motion of another."""
        if not any(other.motions[-1] > other.bar for other in self.undecided if other.motions):
            self.undecided.append(candidate)

    def push(self, stamp_ns: int, motion: float) -> list[Candidate]:
        """Take the motion of the next frame; the candidates whose motion lasted."""
        for candidate in self.undecided:
            candidate.motions.append(motion)
        lasting, undecided = [], []
        for candidate in self.undecided:
            late = stamp_ns - candidate.before_ns > _LONGEST_NS
            seen = len(candidate.motions)
            frames = seen if late else candidate.frames
            if candidate.lacking() > self._lacking * frames:
                continue
            if seen >= frames:
                lasting.append(candidate)
            else:
                undecided.append(candidate)
        self.undecided = undecided
        return lasting

    def onsets(self, confirmed: tuple[int, ...] = ()) -> Onsets:
        """The onsets confirmed now, and those that are not decided."""
        return Onsets(confirmed, tuple(candidate.before_ns for candidate in self.undecided))
