"""Cycles: the shaking events are counted, and each tray image gets the number of its cycle.

Images are held back while an onset of motion is undecided, at most 0.3 s or 24 frames as a rule
and 1 s when frames are missing; all others pass at once.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.shaking.onset_confirmation import Onsets
from nanorocks_ros.stages.preprocess.shaking.shake_detection import MotionMeter

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from nanorocks_ros.records import TrayImage

_NO_ONSETS = Onsets()
# Beads of the trays, and the plate, begin to move within this time of each other: the trays are
# on one plate, but a first small motion may be lost in the noise.
_TOGETHER_NS = NS // 10


class ShakeCounter:
    """Counts the shaking events, by the onsets of motion of the trays and of the plate.

    All trays are on one plate and are shaken together: an event is an onset of the plate, or of
    at least half of the trays.

    Parameters
    ----------
    shortest_cycle : float, [s]

    Attributes
    ----------
    starts_ns : list of int
        Of each event, the stamp of the last frame before it.
    """

    def __init__(self, shortest_cycle: float) -> None:
        # Votes of one event are no second one.
        self._shortest_ns = max(round(shortest_cycle * NS), _TOGETHER_NS + 1)
        self._confirmed: list[tuple[int, ...]] = []
        self._pending_ns: list[int] = []
        self.starts_ns: list[int] = []

    def push(self, trays: Sequence[Onsets], plate: Onsets = _NO_ONSETS) -> bool:
        """Take the onsets that the next frame shows; True when it confirms a shaking event."""
        self._confirmed.extend(onsets.confirmed for onsets in trays if onsets.confirmed)
        votes = sorted(onset for onsets in self._confirmed for onset in onsets)
        waiting = [onset for onsets in (*trays, plate) for onset in onsets.pending]
        self._pending_ns = [onset for onset in waiting if self._may_start(onset)]
        starts = [*plate.confirmed]
        for vote in votes:
            together = [other for other in votes if 0 <= other - vote <= _TOGETHER_NS]
            if trays and 2 * len(together) >= len(trays):
                starts.append(together[(len(together) - 1) // 2])
        oldest = min(waiting, default=None)
        self._confirmed = [
            onsets
            for onsets in self._confirmed
            if oldest is not None and max(onsets) >= oldest - _TOGETHER_NS
        ]
        events = len(self.starts_ns)
        for start in sorted(starts):
            self._start(start)
        return len(self.starts_ns) > events

    @property
    def settled_ns(self) -> float:
        """All events up to this stamp are known; infinite when none is undecided."""
        return min(self._pending_ns, default=math.inf)

    def cycle_at(self, stamp_ns: int) -> tuple[int, int | None]:
        """Number of the cycle of a frame, and its start; None before the first."""
        cycle = bisect_left(self.starts_ns, stamp_ns)
        return cycle, self.starts_ns[cycle - 1] if cycle else None

    def _may_start(self, onset_ns: int) -> bool:
        return not self.starts_ns or onset_ns - self.starts_ns[-1] >= self._shortest_ns

    def _start(self, start_ns: int) -> None:
        if self._may_start(start_ns):
            self.starts_ns.append(start_ns)


class HeldImages:
    """Tray images that wait until their cycle is known.

    Parameters
    ----------
    counter : ShakeCounter
    """

    def __init__(self, counter: ShakeCounter) -> None:
        self._counter = counter
        self._images: deque[TrayImage] = deque()

    def add(self, images: Iterable[TrayImage]) -> None:
        """Take the images of the next frame; one that has a cycle keeps it."""
        self._images.extend(images)

    @property
    def first_ns(self) -> float:
        """Stamp of the first image that waits, [ns]; infinite when none does."""
        return self._images[0].stamp_ns if self._images else math.inf

    def known(self) -> tuple[TrayImage, ...]:
        """The images whose cycle is known now; each is given out once."""
        return self._released(self._counter.settled_ns)

    def flush(self) -> tuple[TrayImage, ...]:
        """All images, at the end of the recording."""
        return self._released(math.inf)

    def _released(self, settled_ns: float) -> tuple[TrayImage, ...]:
        released = []
        while self._images and self._images[0].stamp_ns <= settled_ns:
            released.append(self._counted(self._images.popleft()))
        return tuple(released)

    def _counted(self, image: TrayImage) -> TrayImage:
        if image.cycle is not None:
            return image
        cycle, start_ns = self._counter.cycle_at(image.stamp_ns)
        return replace(image, cycle=cycle, cycle_start_ns=start_ns)


class CycleFollower:
    """Cycle and noise of the images of one tray: carried by the images, or found from them.

    Parameters
    ----------
    ratio : float
        Smallest jump of the motion, as a factor.
    shortest_cycle : float, [s]
    """

    def __init__(self, ratio: float, shortest_cycle: float) -> None:
        self._meter = MotionMeter(ratio)
        self._counter = ShakeCounter(shortest_cycle)
        self._held = HeldImages(self._counter)

    def push(self, image: TrayImage) -> tuple[TrayImage, ...]:
        """Take the next image.

        Returns
        -------
        tuple of TrayImage
            The images whose cycle is known with this one, with their cycle and noise filled in.
        """
        if image.cycle is None or math.isnan(image.noise_power):
            self._counter.push((self._meter.push(image.stamp_ns, image.gray),))
        if math.isnan(image.noise_power):
            image = replace(image, noise_power=self._meter.noise_power)
        self._held.add((image,))
        return self._held.known() if image.cycle is None else self._held.flush()

    def flush(self) -> tuple[TrayImage, ...]:
        """The images that are held back, at the end of the recording."""
        return self._held.flush()
