"""Mean projected speed of the beads from their tracks.

The distance between two places of a bead is longer than its way by the jitter of the places,
and shorter where it collided in between. So it is taken over a time in which beads move well
beyond the jitter; what the jitter adds is subtracted in squares; and from the same beads over
twice the time follows how much collisions shorten it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.tracking.displacements import (
    ALL,
    Series,
    Wanted,
    far_enough,
    jitter_of,
    joined,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

RELIABLE_SHARE = 0.7
"""Of the beads, to be followed through the window: with fewer, simulated speeds were off by more
than 20 % now and then."""

_NS = 1e9
# Least distance wanted, in units of the error of a coordinate: the jitter then adds 2 % to the
# mean square.
_LEAST_ERRORS = 14.0
# The same for the errors that places share for a while, as those by patches of chalk; and the
# part of it without which a speed is not to be relied upon.
_PLACE_ERRORS = 4.0
_SOME = 0.8
# Fast beads are lost more often than slow ones: of the share that is lost, what the mean may be
# too low by. Of grains a quarter was lost at 2 mm/s, and the mean was 10 % too low.
_MISSING = 0.4
# Fewer beads than this say nothing of a mean.
_FEWEST = 3
JITTER_PICTURES = 10
"""Pictures from which the jitter is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanSpeed:
    """Mean projected speed of some beads.

    Parameters
    ----------
    stamp_ns : int
        Middle of the window.
    mean_projected_speed, mean_projected_speed_error : float, [m/s]
        The error is that of the measurement of these beads; not how they, as a sample, scatter.
        NaN when unknown.
    window : float, [s]
    beads : int
        Beads followed through the window.
    share : float
        Of the beads there are.
    reliable : bool
        Whether enough beads were followed (where many are lost, others are confused), and far
        enough to see beyond the errors of their places.
    """

    stamp_ns: int
    mean_projected_speed: float
    mean_projected_speed_error: float
    window: float
    beads: int
    share: float
    reliable: bool


def mean_speed(
    tracks: Sequence[Tracks], *, least_distance: float, species: int | None = None
) -> MeanSpeed | None:
    """Mean projected speed over the end of a series of tracks.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray and in order, up to the present; the longer the series, the slower the beads
        that can be measured.
    least_distance : float, [m]
        Beads should come so far in half of the window, where the series is long enough.
    species : int or None
        Index of the species; all when None.

    Returns
    -------
    MeanSpeed or None
        None while there are fewer than three pictures or beads.
    """
    return mean_speeds(tracks, least_distance=least_distance, species=(species,))[0]


def mean_speeds(
    tracks: Sequence[Tracks], *, least_distance: float, species: Sequence[int | None]
) -> list[MeanSpeed | None]:
    """The same for several species, or all beads where None, of the same tracks."""
    if not tracks:
        return [None for _ in species]
    return mean_speeds_in(
        joined(tracks),
        joined(tracks[-JITTER_PICTURES:]),
        tracks[-1].expected,
        least_distance=least_distance,
        species=species,
    )


def mean_speeds_in(
    series: Series,
    recent: Series,
    expected: NDArray[np.int32],
    *,
    least_distance: float,
    species: Sequence[int | None],
) -> list[MeanSpeed | None]:
    """The same of tracks that are joined already.

    Parameters
    ----------
    series : Series
    recent : Series
        The last `JITTER_PICTURES` of them.
    expected : ndarray of int32, (species,)
        Beads there are.
    least_distance, species
        As of `mean_speed`.
    """
    return [
        _mean_speed(
            series,
            recent,
            least_distance,
            ALL if one is None else one,
            int(expected.sum() if one is None else expected[one]),
        )
        for one in species
    ]


def _mean_speed(
    series: Series, recent: Series, least_distance: float, species: int, expected: int
) -> MeanSpeed | None:
    wanted = Wanted(least_distance * least_distance, _LEAST_ERRORS**2, _PLACE_ERRORS**2, _FEWEST)
    lag, each, *means = far_enough(series, species, jitter_of(recent, species), wanted)
    if not lag:
        return None
    distances = _Distances(*each, *means)
    last = series.stamps.size - 1
    first, middle, end = (int(series.stamps[last - k * lag]) for k in (2, 1, 0))
    window = (end - first) / _NS
    share = distances.both.size / max(expected, 1)
    value, error = distances.speed((end - middle) / _NS, (middle - first) / _NS)
    error = math.hypot(error, _MISSING * max(1.0 - share, 0.0) * value)
    return MeanSpeed(
        stamp_ns=(first + end) // 2,
        mean_projected_speed=value,
        mean_projected_speed_error=error,
        window=window,
        beads=distances.both.size,
        share=share,
        reliable=share >= RELIABLE_SHARE and distances.beyond_errors(),
    )


@dataclass(frozen=True, slots=True)
class _Distances:
    """Of each bead: in the later half of the window, in the earlier, in both.

    `square` is the mean square distance in half of the window; see `distances_of`.
    """

    later: NDArray[np.float64]
    earlier: NDArray[np.float64]
    both: NDArray[np.float64]
    square: float
    variance: float
    place_variance: float

    def beyond_errors(self) -> bool:
        """Whether distances are beyond what chalk that turns does to places."""
        return self.square >= (_SOME * _PLACE_ERRORS) ** 2 * self.place_variance

    def speed(self, later_time: float, earlier_time: float) -> tuple[float, float]:
        half = 0.5 * (
            _mean_distance(self.later, self.variance) / later_time
            + _mean_distance(self.earlier, self.variance) / earlier_time
        )
        whole = _mean_distance(self.both, self.variance) / (later_time + earlier_time)
        # Collisions shorten the distance in proportion to the time, to first order.
        shortened = max(half - whole, 0.0)
        jitter = self._jitter_error(0.5 * (later_time + earlier_time) * half)
        per_time = 2.0 / (later_time + earlier_time)
        bead = np.hypot(self.later - self.earlier, 1e-3 * self.later) * per_time
        scatter = 0.5 * math.sqrt(_mean(bead * bead)) / math.sqrt(self.both.size)
        shared = self._shared_share() * half
        error = math.hypot(jitter * per_time, 0.5 * shortened, 0.8 * scatter, 0.5 * shared)
        return max(half + shortened, 0.0), error

    def _shared_share(self) -> float:
        """Of a distance, what errors that places share for a while may add to it."""
        more = max(self.place_variance - self.variance, 0.0)
        return 1.0 - math.sqrt(max(1.0 - 4.0 * more / max(self.square, 1e-18), 0.0))

    def _jitter_error(self, mean: float) -> float:
        """What jitter leaves open of a mean distance; less of a long one than of none, [m]."""
        of_square = 4.0 * self.variance / math.sqrt(self.both.size)
        of_none = min(math.sqrt(of_square), 0.5 * of_square / max(mean, 1e-12))
        return math.hypot(math.sqrt(2.0 * self.variance / self.both.size), of_none)


def _mean_distance(distances: NDArray[np.float64], variance: float) -> float:
    """Mean distance without the jitter of its ends, for places that scatter as Gaussians.

    Exact for a Maxwellian gas, where the jitter widens a Gaussian by another.
    """
    square = _mean(distances * distances)
    left = square - 4.0 * variance
    if left <= 0.0:
        return 0.0
    return _mean(distances) * math.sqrt(left / square)


def _mean(values: NDArray[np.float64]) -> float:
    """As of numpy, which takes longer to find out over what."""
    return float(np.add.reduce(values)) / values.size
