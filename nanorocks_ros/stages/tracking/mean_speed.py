"""Mean projected speed of the beads from their tracks.

Noise makes the distance between two positions of a bead longer than its path, collisions make it
shorter. The distance is taken over a lag at which displacements are well above the noise. The
variance of the noise is subtracted. Displacements over twice the lag give the shortening by
collisions.

Beads that are not seen are not a random sample. Fast ones are lost more often: a bead counts that
is seen in the middle frame and at one of the ends, not only one seen in all three. In a mixture
one species hides the other: each species counts by its number of beads in the tray, and each bead
for those that its surroundings hide (`hidden_beads`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.bead_distances import speed_in_window
from nanorocks_ros.stages.tracking.displacements import (
    ALL_SPECIES,
    MinDisplacement,
    TrackSeries,
    join_tracks,
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
# whole windows 7/4 s^2 / d^2 too high: 2.7 %; longer paths lose as much by collisions.
_MIN_ERROR_RATIO = 8.0
LOSS_BIAS = 0.4
"""Relative error of the mean over the share of lost beads: fast beads are lost more often. At
2 mm/s a quarter of the grains was lost, and the mean was 10 % too low."""
CUT_LOSS_BIAS = 0.2
"""The same where tracks are cut as they jump, from drawn films of tray 7: crowded grains, which
are lost more often, are slower."""

# Smallest number of beads of a mean.
_MIN_BEADS = 3
_NO_FLOOR = (math.nan, math.nan)
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
    hidden : float, 0 to 1
        Share of the beads that lie under others, of the species that has most of them.
    """

    stamp_ns: int
    mean_projected_speed: float
    mean_projected_speed_error: float
    window: float
    beads: int
    share: float
    reliable: bool
    beyond_errors: bool
    hidden: float

    @property
    def share_of_visible(self) -> float:
        """Share of those beads that do not lie under others which have tracks."""
        return self.share / (1.0 - self.hidden)


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
    floor: tuple[float, float] | None = None,
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
    floor : tuple of 2 floats or None, [m]
        Its sides; None: nothing is said of beads that lie under others.
    """
    told = _Told(expected, floor, loss_bias)
    return [
        _mean_speed(series, recent, least_distance, ALL_SPECIES if index is None else index, told)
        for index in species
    ]


class _Told(NamedTuple):
    """What is known of the beads in the tray; as in `mean_speeds_of_series`."""

    expected: NDArray[np.int32]
    floor: tuple[float, float] | None
    loss_bias: float

    def of(self, species: int) -> NDArray[np.int32]:
        """Number of beads of each species; 0 of those that do not count."""
        # Always another array, which may be written: numba compiles for one kind.
        counts = (species == ALL_SPECIES) | (np.arange(self.expected.size) == species)
        return np.where(counts, self.expected, 0).astype(np.int32)


def _mean_speed(
    series: TrackSeries,
    recent: TrackSeries,
    least_distance: float,
    species: int,
    told: _Told,
) -> MeanSpeed | None:
    minimum = MinDisplacement(
        least_distance * least_distance, _MIN_NOISE_RATIO**2, _MIN_ERROR_RATIO**2, _MIN_BEADS
    )
    counted = told.of(species)
    floor = _NO_FLOOR if told.floor is None else told.floor
    lag, beads, value, error, exceeds_errors, hidden = speed_in_window(
        series, recent, species, told.expected, counted, floor, minimum
    )
    if not lag:
        return None
    last = series.stamps.size - 1
    end, first = int(series.stamps[last]), int(series.stamps[last - 2 * lag])
    share = beads / max(int(counted.sum()), 1)
    error = math.hypot(error, told.loss_bias * max(1.0 - share, 0.0) * value)
    return MeanSpeed(
        stamp_ns=(first + end) // 2,
        mean_projected_speed=value,
        mean_projected_speed_error=error,
        window=(end - first) / _NS,
        beads=beads,
        share=share,
        reliable=share >= RELIABLE_SHARE and exceeds_errors,
        beyond_errors=exceeds_errors,
        hidden=hidden,
    )
