"""Mean speed in a window, from the distances that single beads moved between its frames.

Tested by ``test/stages/tracking/test_mean_speed.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.displacements import (
    MinDisplacement,
    TrackSeries,
    displacements_beyond_noise,
    pair_displacements,
    position_noise,
)
from nanorocks_ros.stages.tracking.hidden_beads import bead_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Smallest ratio of displacements to the errors of positions at which a speed is reliable.
_RELIABLE_RATIO = 3.2
# Smallest share of a species that is taken for a sample of all of it.
_MIN_SAMPLE_SHARE = 0.3
HIDDEN_ERROR = 0.7
"""Error of the correction for hidden beads over the correction: in drawn films it left 0.2 to 1 of
itself."""
_NS = 1e9


class PairDistances(NamedTuple):
    """Distances of the beads seen at both ends of half of the window, wherever else they are.

    Parameters
    ----------
    distances : ndarray (n,), [m]
    species : ndarray of int32, (n,)
    weights : ndarray (n,)
        How many beads of its species each one stands for.
    duration : float, [s]
        Of the half.
    """

    distances: NDArray[np.float64]
    species: NDArray[np.int32]
    weights: NDArray[np.float64]
    duration: float


class BeadDistances(NamedTuple):
    """Distances of the beads that are seen at both ends and in the middle of the window.

    Parameters
    ----------
    each : ndarray (3, n), [m]
        In the later half of the window, in the earlier half and in both.
    square, variance, position_variance : float, [m^2]
        See `displacements_between`; `square` is that in half of the window.
    """

    each: NDArray[np.float64]
    square: float
    variance: float
    position_variance: float


@compiled
def speed_in_window(
    series: TrackSeries,
    recent: TrackSeries,
    species: int,
    expected: NDArray[np.int32],
    counted: NDArray[np.int32],
    floor: tuple[float, float],
    minimum: MinDisplacement,
) -> tuple[int, int, float, float, bool, float]:
    """Mean speed of the beads in the last frames.

    Parameters
    ----------
    series : TrackSeries
    recent : TrackSeries
        The last frames of them, which show the noise.
    species : int
        Index of the species, or `ALL_SPECIES`.
    expected : ndarray of int32, (species,)
        Number of beads in the tray.
    counted : ndarray of int32, (species,)
        The same, and 0 of species that do not count.
    floor : tuple of 2 floats, [m]
        Its sides; NaN: nothing is said of beads that lie under others.
    minimum : MinDisplacement

    Returns
    -------
    lag : int
        Half of the window in frames; 0 where there is no speed.
    beads : int
        Number of beads with tracks through the window.
    speed, error : float, [m/s]
    exceeds_errors : bool
        Whether displacements exceed the errors of positions, as from chalk that turns.
    hidden : float
        Share of the beads that lie under others.
    """
    noise = position_noise(recent, species)
    lag, each, square, variance, position_variance = displacements_beyond_noise(
        series, species, noise, minimum
    )
    if lag == 0:
        return 0, 0, math.nan, math.nan, False, 0.0
    distances = BeadDistances(each, square, variance, position_variance)
    last = series.stamps.size - 1
    middle = last - lag
    of_middle, hidden = np.ones(series.first[middle + 1] - series.first[middle]), 0.0
    if floor[0] == floor[0]:
        of_middle, hidden = bead_weights(series, middle, species, counted, floor)
    later = _pairs(series, (last, middle), 1, species, of_middle)
    earlier = _pairs(series, (middle, middle - lag), 0, species, of_middle)
    speed, error = _speed(distances, later, earlier, expected)
    exceeds_errors = square >= _RELIABLE_RATIO**2 * position_variance
    return lag, each.shape[1], speed, error, bool(exceeds_errors), hidden


@compiled
def _pairs(
    series: TrackSeries,
    frames: tuple[int, int],
    middle: int,
    species: int,
    of_middle: NDArray[np.float64],
) -> PairDistances:
    """Distances between two frames, of which that with the number `middle` has these weights."""
    distances, rows = pair_displacements(series, frames[0], frames[1], species)
    first = series.first[frames[middle]]
    duration = (series.stamps[frames[0]] - series.stamps[frames[1]]) / _NS
    return PairDistances(
        distances, series.species[rows[0]], of_middle[rows[middle] - first], duration
    )


@compiled
def _speed(
    distances: BeadDistances,
    later: PairDistances,
    earlier: PairDistances,
    expected: NDArray[np.int32],
) -> tuple[float, float]:
    """Mean speed and its error, [m/s]."""
    variance, each = distances.variance, distances.each
    whole = later.duration + earlier.duration
    alike = np.ones(each.shape[1])
    of_three = 0.5 * (
        _mean_distance(each[0], variance, alike) / later.duration
        + _mean_distance(each[1], variance, alike) / earlier.duration
    )
    full = _mean_distance(each[2], variance, alike) / whole
    half = _half_speed(later, earlier, expected, variance, True)
    of_seen = _half_speed(later, earlier, expected, variance, False)
    # Collisions shorten the distance in proportion to the time, to first order.
    shortened = half * max(1.0 - full / of_three, 0.0) if of_three > 0.0 else 0.0
    beads, per_time = each.shape[1], 2.0 / whole
    noise_error = _jitter_error(variance, beads, 0.5 * whole * half) * per_time
    squares = 0.0
    for k in range(beads):
        x, y = each[0, k] - each[1, k], 1e-3 * each[0, k]
        squares += (x * x + y * y) * per_time * per_time
    scatter = 0.5 * math.sqrt(squares) / beads
    shared_error = _shared_share(distances) * half
    hidden_error = HIDDEN_ERROR * (half - of_seen)
    error = math.sqrt(
        noise_error * noise_error
        + 0.25 * shortened * shortened
        + scatter * scatter
        + shared_error * shared_error
        + hidden_error * hidden_error
    )
    return max(half + shortened, 0.0), error


@compiled
def _half_speed(
    later: PairDistances,
    earlier: PairDistances,
    expected: NDArray[np.int32],
    variance: float,
    hidden: bool,
) -> float:
    """Mean speed over half of the window, [m/s]; see `_sampled_distance`."""
    return 0.5 * (
        _sampled_distance(later, expected, variance, hidden) / later.duration
        + _sampled_distance(earlier, expected, variance, hidden) / earlier.duration
    )


@compiled
def _sampled_distance(
    pairs: PairDistances, expected: NDArray[np.int32], variance: float, hidden: bool
) -> float:
    """Mean over all beads in the tray: those of a species stand for the unseen ones of it.

    `hidden` is whether each bead stands for those that its surroundings hide, `variance` that of a
    coordinate, [m^2].
    """
    seen, sums = np.zeros(expected.size), np.zeros(expected.size)
    weights = pairs.weights.copy() if hidden else np.ones(pairs.weights.size)
    for k in range(weights.size):
        seen[pairs.species[k]] += 1.0
        sums[pairs.species[k]] += weights[k]
    for k in range(weights.size):
        kind = pairs.species[k]
        fewest = max(_MIN_SAMPLE_SHARE * expected[kind], 1.0)
        weights[k] *= expected[kind] / max(seen[kind], fewest) * seen[kind] / max(sums[kind], 1.0)
    return _mean_distance(pairs.distances, variance, weights)


@compiled
def _mean_distance(
    distances: NDArray[np.float64], variance: float, weights: NDArray[np.float64]
) -> float:
    """Mean distance corrected for Gaussian noise of both positions, [m].

    Exact for a Maxwellian gas.
    """
    total, first, second = 0.0, 0.0, 0.0
    for k in range(distances.size):
        total += weights[k]
        first += weights[k] * distances[k]
        second += weights[k] * distances[k] * distances[k]
    square = second / total
    corrected = square - 4.0 * variance
    if corrected <= 0.0:
        return 0.0
    return first / total * math.sqrt(corrected / square)


@compiled
def _shared_share(distances: BeadDistances) -> float:
    """Relative error of a distance from errors that positions share for some time."""
    shared_variance = max(distances.position_variance - distances.variance, 0.0)
    left = 1.0 - 4.0 * shared_variance / max(distances.square, 1e-18)
    return 1.0 - math.sqrt(max(left, 0.0))


@compiled
def _jitter_error(variance: float, beads: int, mean: float) -> float:
    """Error of a mean distance from noise, [m]; smaller for a long distance than for none."""
    square_error = 4.0 * variance / math.sqrt(beads)
    rest_error = min(math.sqrt(square_error), 0.5 * square_error / max(mean, 1e-12))
    return math.sqrt(2.0 * variance / beads + rest_error * rest_error)
