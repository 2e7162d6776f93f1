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
# Largest loss whose square counts: beads that are caged, or badly placed, are no random walk.
_MAX_LOST = 0.1
HIDDEN_ERROR = 0.7
"""Error of the correction for hidden beads over the correction: in drawn films it left 0.2 to 1 of
itself."""
_NS = 1e9


class MiddleBeads(NamedTuple):
    """Speeds of the beads seen in the middle of the window, each in the halves that it is seen in.

    A fast bead is lost more often than a slow one. One that is lost in a half counts with its
    speed in the other: with the beads of each half alone, means of films of 80 beads by other
    code were 1 to 2 % lower.

    Parameters
    ----------
    speeds : ndarray (n,), [m/s]
    squares : ndarray (n,), [m^2/s^2]
        Mean squares of the speeds in the halves.
    species : ndarray of int32, (n,)
    weights : ndarray (n,)
        How many beads of its species each one stands for.
    """

    speeds: NDArray[np.float64]
    squares: NDArray[np.float64]
    species: NDArray[np.int32]
    weights: NDArray[np.float64]


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
    durations = (
        (series.stamps[last] - series.stamps[middle]) / _NS,
        (series.stamps[middle] - series.stamps[middle - lag]) / _NS,
    )
    beads = _middle_beads(series, (last, middle, middle - lag), durations, species, of_middle)
    speed, error = _speed(distances, beads, durations, expected)
    exceeds_errors = square >= _RELIABLE_RATIO**2 * position_variance
    return lag, each.shape[1], speed, error, bool(exceeds_errors), hidden


@compiled
def _middle_beads(
    series: TrackSeries,
    frames: tuple[int, int, int],
    durations: tuple[float, float],
    species: int,
    of_middle: NDArray[np.float64],
) -> MiddleBeads:
    """Speeds in the halves between three frames, the latest first, in each half that shows it."""
    last, middle, earliest = frames
    later, rows_of_later = pair_displacements(series, last, middle, species)
    earlier, rows_of_earlier = pair_displacements(series, middle, earliest, species)
    first = series.first[middle]
    halves = np.zeros(of_middle.size)
    sums, squares = np.zeros(of_middle.size), np.zeros(of_middle.size)
    for k in range(later.size):
        row, speed = rows_of_later[1, k] - first, later[k] / durations[0]
        halves[row], sums[row], squares[row] = 1.0, speed, speed * speed
    for k in range(earlier.size):
        row, speed = rows_of_earlier[0, k] - first, earlier[k] / durations[1]
        halves[row] += 1.0
        sums[row] += speed
        squares[row] += speed * speed
    rows = np.flatnonzero(halves)
    return MiddleBeads(
        sums[rows] / halves[rows],
        squares[rows] / halves[rows],
        series.species[first + rows],
        of_middle[rows],
    )


@compiled
def _speed(
    distances: BeadDistances,
    beads: MiddleBeads,
    durations: tuple[float, float],
    expected: NDArray[np.int32],
) -> tuple[float, float]:
    """Mean speed and its error, [m/s]."""
    variance, each = distances.variance, distances.each
    whole = durations[0] + durations[1]
    of_three = 0.5 * (
        _mean_distance(each[0], variance) / durations[0]
        + _mean_distance(each[1], variance) / durations[1]
    )
    full = _mean_distance(each[2], variance) / whole
    of_speeds = variance * 0.5 * (1.0 / durations[0] ** 2 + 1.0 / durations[1] ** 2)
    half = _sampled_speed(beads, expected, of_speeds, True)
    of_seen = _sampled_speed(beads, expected, of_speeds, False)
    lost = max(1.0 - full / of_three, 0.0) if of_three > 0.0 else 0.0
    shortened = half * _path_over_distance(lost)
    count, per_time = each.shape[1], 2.0 / whole
    noise_error = _jitter_error(variance, count, 0.5 * whole * half) * per_time
    squares = 0.0
    for k in range(count):
        x, y = each[0, k] - each[1, k], 1e-3 * each[0, k]
        squares += (x * x + y * y) * per_time * per_time
    scatter = 0.5 * math.sqrt(squares) / count
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
def _path_over_distance(lost: float) -> float:
    """How much longer a path is than the distance in half of the window, relative to that.

    A persistent random walk whose direction lasts a time T moves in a time t = x T by the root
    mean square distance v t f(x), f(x)^2 = 2 (x - 1 + exp(-x)) / x^2, or 1 - x/6 + x^2/36 to
    second order. Twice the time then loses, beside half of it, the share u = x/6 - x^2/18;
    1/f - 1 = x/6 = u + 2 u^2.

    Parameters
    ----------
    lost : float
        Share u of the distance that the whole window loses beside its halves.
    """
    few = min(lost, _MAX_LOST)
    return lost + 2.0 * few * few


@compiled
def _sampled_speed(
    beads: MiddleBeads, expected: NDArray[np.int32], variance: float, hidden: bool
) -> float:
    """Mean over all beads in the tray: those of a species stand for the unseen ones of it, [m/s].

    `hidden` is whether each bead stands for those that its surroundings hide, `variance` that of a
    coordinate over the square of the time, [m^2/s^2].
    """
    seen, sums = np.zeros(expected.size), np.zeros(expected.size)
    weights = beads.weights.copy() if hidden else np.ones(beads.weights.size)
    for k in range(weights.size):
        seen[beads.species[k]] += 1.0
        sums[beads.species[k]] += weights[k]
    for k in range(weights.size):
        kind = beads.species[k]
        fewest = max(_MIN_SAMPLE_SHARE * expected[kind], 1.0)
        weights[k] *= expected[kind] / max(seen[kind], fewest) * seen[kind] / max(sums[kind], 1.0)
    total, first, second = 0.0, 0.0, 0.0
    for k in range(weights.size):
        total += weights[k]
        first += weights[k] * beads.speeds[k]
        second += weights[k] * beads.squares[k]
    return _without_noise(first / total, second / total, variance)


@compiled
def _mean_distance(distances: NDArray[np.float64], variance: float) -> float:
    """Mean distance corrected for Gaussian noise of both positions, [m]."""
    first, second = 0.0, 0.0
    for k in range(distances.size):
        first += distances[k]
        second += distances[k] * distances[k]
    return _without_noise(first / distances.size, second / distances.size, variance)


@compiled
def _without_noise(mean: float, square: float, variance: float) -> float:
    """A mean distance without the noise, by its mean square; exact for a Maxwellian gas."""
    corrected = square - 4.0 * variance
    return mean * math.sqrt(corrected / square) if corrected > 0.0 else 0.0


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
