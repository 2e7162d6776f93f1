"""Mean projected speed of the beads from their tracks.

Noise makes the distance between two positions of a bead longer than its path, collisions make it
shorter. The distance is taken over a lag at which displacements are well above the noise. The
variance of the noise is subtracted. Displacements over twice the lag give the shortening by
collisions.

Beads that are not seen are not a random sample. Fast ones are lost more often: a bead counts that
is seen in two frames, not only one seen in all three. In a mixture one species hides the other:
each species counts by its number of beads in the tray.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.tracking.displacements import (
    ALL_SPECIES,
    MinDisplacement,
    TrackSeries,
    displacements_beyond_noise,
    join_tracks,
    pair_displacements,
    position_noise,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

RELIABLE_SHARE = 0.7
"""Smallest share of the beads with tracks through the window. With fewer, simulated speeds were
sometimes wrong by more than 20 %."""

_NS = 1e9
# Smallest displacement over the error of a coordinate: the noise then adds 2 % to the mean square.
_MIN_NOISE_RATIO = 14.0
# The same for all errors, which positions share for some time, such as those from patches of
# chalk. Errors s that the ends of a path do not share make a speed from distances d in half and
# whole windows 7/4 s^2 / d^2 too high: 2.7 %; longer paths lose as much by collisions. And the
# ratio below which a speed is unreliable.
_MIN_ERROR_RATIO = 8.0
_RELIABLE_RATIO = 3.2
LOSS_BIAS = 0.4
"""Relative error of the mean over the share of lost beads: fast beads are lost more often. At
2 mm/s a quarter of the grains was lost, and the mean was 10 % too low."""
CUT_LOSS_BIAS = 0.2
"""The same where tracks are cut as they jump, from drawn films of tray 7: crowded grains, which
are lost more often, are slower."""

# Smallest number of beads of a mean.
_MIN_BEADS = 3
# Smallest share of a species that is taken for a sample of all of it.
_MIN_SAMPLE_SHARE = 0.3
NOISE_FRAMES = 10
"""Number of frames from which the noise is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanSpeed:
    """Mean projected speed of some beads.

    Parameters
    ----------
    stamp_ns : int
        Middle of the window.
    mean_projected_speed, mean_projected_speed_error : float, [m/s]
        The error is that of the measurement, without the scatter of the sample of beads. NaN if
        unknown.
    window : float, [s]
    beads : int
        Number of beads with tracks through the window.
    share : float
        Share of the expected beads.
    reliable : bool
        Whether enough beads have tracks (where many are lost, others are linked wrongly), and
        displacements exceed the position errors.
    beyond_errors : bool
        Whether displacements exceed the position errors.
    """

    stamp_ns: int
    mean_projected_speed: float
    mean_projected_speed_error: float
    window: float
    beads: int
    share: float
    reliable: bool
    beyond_errors: bool


def mean_speed(
    tracks: Sequence[Tracks], *, least_distance: float, species: int | None = None
) -> MeanSpeed | None:
    """Mean projected speed over the end of a series of tracks.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray, in order, up to the present. Slow beads need a long series.
    least_distance : float, [m]
        Smallest displacement in half of the window, if the series is long enough.
    species : int or None
        Index of the species; None for all.

    Returns
    -------
    MeanSpeed or None
        None with fewer than three frames or beads.
    """
    return mean_speeds(tracks, least_distance=least_distance, species=(species,))[0]


def mean_speeds(
    tracks: Sequence[Tracks], *, least_distance: float, species: Sequence[int | None]
) -> list[MeanSpeed | None]:
    """Mean speeds of several species of the same tracks; None stands for all beads."""
    if not tracks:
        return [None for _ in species]
    return mean_speeds_of_series(
        join_tracks(tracks),
        join_tracks(tracks[-NOISE_FRAMES:]),
        tracks[-1].expected,
        least_distance=least_distance,
        species=species,
    )


def mean_speeds_of_series(
    series: TrackSeries,
    recent: TrackSeries,
    expected: NDArray[np.int32],
    *,
    least_distance: float,
    species: Sequence[int | None],
    loss_bias: float = LOSS_BIAS,
) -> list[MeanSpeed | None]:
    """Mean speeds of several species of concatenated tracks.

    Parameters
    ----------
    series : TrackSeries
    recent : TrackSeries
        The last `NOISE_FRAMES` of them.
    expected : ndarray of int32, (species,)
        Number of beads in the tray.
    least_distance, species
        As in `mean_speed`.
    loss_bias : float
        Relative error of the mean over the share of lost beads.
    """
    return [
        _mean_speed(
            series,
            recent,
            least_distance,
            ALL_SPECIES if index is None else index,
            expected,
            loss_bias,
        )
        for index in species
    ]


def _mean_speed(
    series: TrackSeries,
    recent: TrackSeries,
    least_distance: float,
    species: int,
    expected: NDArray[np.int32],
    loss_bias: float,
) -> MeanSpeed | None:
    minimum = MinDisplacement(
        least_distance * least_distance, _MIN_NOISE_RATIO**2, _MIN_ERROR_RATIO**2, _MIN_BEADS
    )
    lag, distance_rows, *means = displacements_beyond_noise(
        series, species, position_noise(recent, species), minimum
    )
    if not lag:
        return None
    frames = tuple(series.stamps.size - 1 - k * lag for k in range(3))
    halves = tuple(
        _Half(*pair_displacements(series, later, earlier, species), expected)
        for later, earlier in pairwise(frames)
    )
    distances = _Distances(halves, *distance_rows, *means)
    end, middle, first = (int(series.stamps[frame]) for frame in frames)
    window = (end - first) / _NS
    beads = int(expected.sum() if species == ALL_SPECIES else expected[species])
    share = distances.whole_window.size / max(beads, 1)
    value, error = distances.speed((end - middle) / _NS, (middle - first) / _NS)
    error = math.hypot(error, loss_bias * max(1.0 - share, 0.0) * value)
    return MeanSpeed(
        stamp_ns=(first + end) // 2,
        mean_projected_speed=value,
        mean_projected_speed_error=error,
        window=window,
        beads=distances.whole_window.size,
        share=share,
        reliable=share >= RELIABLE_SHARE and distances.exceed_errors(),
        beyond_errors=distances.exceed_errors(),
    )


@dataclass(frozen=True, slots=True)
class _Half:
    """Distances and species of the beads seen at both ends of half of the window.

    `expected` is the number of beads of each species in the tray.
    """

    distances: NDArray[np.float64]
    species: NDArray[np.int64]
    expected: NDArray[np.int32]

    def mean_distance(self, variance: float) -> float:
        """Mean over all beads in the tray: those of a species stand for the unseen ones of it."""
        seen = np.bincount(self.species, minlength=self.expected.size)
        fewest = np.maximum(_MIN_SAMPLE_SHARE * self.expected, 1.0)
        weights = self.expected / np.maximum(seen, fewest)
        return _mean_distance(self.distances, variance, weights[self.species])


@dataclass(frozen=True, slots=True)
class _Distances:
    """Distances of each bead in the later half of the window, in the earlier half and in both.

    `square` is the mean square distance in half of the window; see `displacements_between`.
    `halves` are the beads seen at both ends of the later and the earlier half, wherever they are
    at the other end of the window.
    """

    halves: tuple[_Half, ...]
    later: NDArray[np.float64]
    earlier: NDArray[np.float64]
    whole_window: NDArray[np.float64]
    square: float
    variance: float
    position_variance: float

    def exceed_errors(self) -> bool:
        """Whether displacements exceed the position errors, such as those from rotating chalk."""
        return self.square >= _RELIABLE_RATIO**2 * self.position_variance

    def speed(self, later_time: float, earlier_time: float) -> tuple[float, float]:
        of_three = 0.5 * (
            _mean_distance(self.later, self.variance) / later_time
            + _mean_distance(self.earlier, self.variance) / earlier_time
        )
        full = _mean_distance(self.whole_window, self.variance) / (later_time + earlier_time)
        half = 0.5 * sum(
            part.mean_distance(self.variance) / time
            for part, time in zip(self.halves, (later_time, earlier_time), strict=True)
        )
        # Collisions shorten the distance in proportion to the time, to first order.
        shortened = half * max(1.0 - full / of_three, 0.0) if of_three > 0.0 else 0.0
        noise_error = self._jitter_error(0.5 * (later_time + earlier_time) * half)
        per_time = 2.0 / (later_time + earlier_time)
        bead_scatter = np.hypot(self.later - self.earlier, 1e-3 * self.later) * per_time
        scatter = (
            0.5 * math.sqrt(_mean(bead_scatter * bead_scatter)) / math.sqrt(self.whole_window.size)
        )
        shared_error = self._shared_share() * half
        error = math.hypot(noise_error * per_time, 0.5 * shortened, scatter, shared_error)
        return max(half + shortened, 0.0), error

    def _shared_share(self) -> float:
        """Relative error of a distance from errors that positions share for some time."""
        shared_variance = max(self.position_variance - self.variance, 0.0)
        return 1.0 - math.sqrt(max(1.0 - 4.0 * shared_variance / max(self.square, 1e-18), 0.0))

    def _jitter_error(self, mean: float) -> float:
        """Error of a mean distance from noise, [m]; smaller for a long distance than for none."""
        square_error = 4.0 * self.variance / math.sqrt(self.whole_window.size)
        rest_error = min(math.sqrt(square_error), 0.5 * square_error / max(mean, 1e-12))
        return math.hypot(math.sqrt(2.0 * self.variance / self.whole_window.size), rest_error)


def _mean_distance(
    distances: NDArray[np.float64],
    variance: float,
    weights: NDArray[np.float64] | float = 1.0,
) -> float:
    """Mean distance corrected for Gaussian noise of both positions.

    Exact for a Maxwellian gas.
    """
    total = _mean(np.ones(distances.size) * weights)
    square = _mean(weights * distances * distances) / total
    corrected = square - 4.0 * variance
    if corrected <= 0.0:
        return 0.0
    return _mean(weights * distances) / total * math.sqrt(corrected / square)


def _mean(values: NDArray[np.float64]) -> float:
    """Mean of an array, faster than `numpy.mean` for short arrays."""
    return float(np.add.reduce(values)) / values.size
