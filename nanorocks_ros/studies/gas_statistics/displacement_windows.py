"""The beads of a tray in frames of one cycle, and their displacements between three of them.

Tested by ``test/studies/gas_statistics/test_velocity_samples.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import NS
from nanorocks_ros.stages.tracking.displacements import join_tracks, position_noise

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Largest position error of a bead that is used, over the median: half hidden beads are placed
# poorly.
_MAX_ERROR_RATIO = 5.0
# Largest relative difference of the two halves of a window.
_MAX_UNEVEN = 0.2
# Time over which speeds hardly change and enough beads are seen to choose a window, [s].
_CHUNK = 1.0


class Beads(NamedTuple):
    """The beads of a frame that are seen well.

    Parameters
    ----------
    ids, species : ndarray of int, (n,)
        Numbers rise.
    positions : ndarray (n, 2), [m]
        Past the camera: the tray may swing.
    places : ndarray (n, 2), [m]
        From the corner of the tray.
    """

    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    positions: NDArray[np.float64]
    places: NDArray[np.float64]


class Window(NamedTuple):
    """Beads that are seen in three frames at equal distances in time.

    Parameters
    ----------
    species : ndarray of int, (n,)
    steps : ndarray (2, n, 2), [m]
        Displacements in the first and in the second half.
    seconds : float
        Length of one half.
    places : ndarray (n, 2), [m]
        In the middle, from the corner of the tray.
    """

    species: NDArray[np.int32]
    steps: NDArray[np.float64]
    seconds: float
    places: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CycleTracks:
    """The tracks of one cycle, from some time after its shaking event.

    Parameters
    ----------
    number : int
        Of the cycle.
    start_ns : int
        Stamp of its first frame.
    records : sequence of Tracks
    """

    number: int
    start_ns: int
    records: Sequence[Tracks]

    @cached_property
    def beads(self) -> list[Beads]:
        """Of each frame."""
        return [_well_seen(record) for record in self.records]

    @cached_property
    def times(self) -> NDArray[np.float64]:
        """Of each frame, (n_frames,), [s] since the shaking event."""
        stamps = np.array([record.stamp_ns - self.start_ns for record in self.records])
        times: NDArray[np.float64] = stamps / NS
        return times

    def chunks(self) -> Iterator[slice]:
        """Frames of successive seconds; a rest at the end belongs to the last one."""
        if len(self.records) == 0:
            return
        n = max(1, int((self.times[-1] - self.times[0]) / _CHUNK))
        edges = np.searchsorted(self.times, self.times[0] + _CHUNK * np.arange(n))
        for first, last in zip(edges, [*edges[1:], len(self.records)], strict=True):
            if last > first:
                yield slice(int(first), int(last))

    def noise(self, chunk: slice, n_species: int) -> NDArray[np.float64]:
        """Variance of a coordinate between frames, by species, (n_species,), [m^2].

        Measured from the paths, and no more than the stated errors: whatever exceeds these are
        collisions. Infinite where it cannot be measured.
        """
        records = self.records[chunk]
        series = join_tracks(records)
        noise = np.full(n_species, math.inf)
        for index in range(n_species):
            own = series.errors[(series.species == index) & series.seen]
            if own.size:
                measured = position_noise(series, index)
                noise[index] = min(measured, float(np.median(own)) ** 2)
        return noise

    def window(self, frame: int, lag: int) -> Window | None:
        """Displacements from a frame over the next `lag` frames, and over those after them.

        Returns
        -------
        Window or None
            None at the end of the cycle, and where frames are lost.
        """
        frames = frame, frame + lag, frame + 2 * lag
        if frames[-1] >= len(self.records):
            return None
        first, second = np.diff(self.times[list(frames)])
        if abs(first - second) > _MAX_UNEVEN * first:
            return None
        earlier, middle, later = (self.beads[number] for number in frames)
        _, rows, others = np.intersect1d(
            earlier.ids, middle.ids, assume_unique=True, return_indices=True
        )
        _, kept, last = np.intersect1d(
            middle.ids[others], later.ids, assume_unique=True, return_indices=True
        )
        rows, others = rows[kept], others[kept]
        steps = np.stack(
            (
                middle.positions[others] - earlier.positions[rows],
                later.positions[last] - middle.positions[others],
            )
        )
        return Window(
            middle.species[others], steps, 0.5 * float(first + second), middle.places[others]
        )


def _well_seen(record: Tracks) -> Beads:
    usable = record.seen & np.isfinite(record.positions).all(axis=1)
    if usable.any():
        usable &= record.position_errors <= _MAX_ERROR_RATIO * np.median(
            record.position_errors[usable]
        )
    places = record.positions[usable]
    return Beads(record.ids[usable], record.species[usable], places + record.displacement, places)


def split_cycles(
    tracks: Sequence[Tracks], start: float = 0.0, end: float = math.inf
) -> list[CycleTracks]:
    """The cycles of a recording.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray, in order.
    start, end : float, [s]
        Part of each cycle that is used, since its shaking event. What was recorded before the
        first shaking event counts as a cycle, from its first frame on, only if there is no other.
    """
    numbers = np.array([record.cycle for record in tracks])
    after = [int(number) for number in np.unique(numbers) if number > 0]
    cycles = []
    for number in after or ([0] if numbers.size else []):
        own = [record for record in tracks if record.cycle == number]
        first = own[0].stamp_ns
        low = start if number else 0.0
        used = [record for record in own if low <= (record.stamp_ns - first) / NS <= end]
        if used:
            cycles.append(CycleTracks(number=number, start_ns=first, records=used))
    return cycles
