"""Link probabilities between known beads and the detections of a frame.

Tested by ``test/stages/tracking/test_tracker.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.linking.assignment import Costs, assign

if TYPE_CHECKING:
    from numpy.typing import NDArray

RADIUS_NOISE_PX = 0.3
"""Noise of a measured radius between frames, beside its stated error, [px]."""
MIN_VELOCITY_CHANGE_PX_S = 6.0
"""Smallest change of velocity in a collision that the linking allows for, [px/s]."""

# Shares of the beads that collide, or are shaken, between two frames.
_COLLISION_SHARE, _SHAKEN_SHARE = 0.15, 0.002
# Share of outliers among the positions, and their size in radii: within one radius there is no
# other bead, except above or below.
_OUTLIER_SHARE, _OUTLIER_RADII = 0.02, 0.4
# Largest squared deviation of a link, in variances.
_MAX_SQUARED_SIGMAS = 16.0
_MAX_RADIUS_COST = 6.0
# Variance of a position after a collision about the midpoint between the last and the predicted
# position, over that of the change of velocity times the time.
_COLLISION_VARIANCE_FACTOR = 0.5
# Share of beads without a possible link above which the tray was shaken.
_MAX_LOST_SHARE = 0.3
# Largest cost of a link above the lowest cost of the same bead.
_MAX_COST_DIFFERENCE = 10.0


class KnownBeads(NamedTuple):
    """Predictions for the known beads.

    Parameters
    ----------
    predicted, variances : ndarrays (n, 2), (n,), [px], [px^2]
        Predicted positions, and the variance of a coordinate.
    last_positions : ndarray (n, 2), [px]
        Positions where they were last detected.
    elapsed : ndarray (n,), [s]
        Time since then.
    expected_radii : ndarray (n,), [px]
        Radii of the tracks.
    """

    predicted: NDArray[np.float64]
    variances: NDArray[np.float64]
    last_positions: NDArray[np.float64]
    elapsed: NDArray[np.float64]
    expected_radii: NDArray[np.float64]


class DetectedBeads(NamedTuple):
    """Detections in a frame: positions (m, 2), their errors, radii, their errors, [px]."""

    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]


@compiled
def link_detections(
    known_beads: KnownBeads, detected: DetectedBeads, velocity_change: float, max_speed: float
) -> NDArray[np.int64]:
    """Link known beads with detections: index of the detection of each bead, or -1.

    Any bead may collide. If many beads are out of reach even of collisions, the tray was shaken.

    Parameters
    ----------
    known_beads, detected : KnownBeads, DetectedBeads
    velocity_change : float, [px/s]
        Standard deviation of the change of a velocity component in a collision.
    max_speed : float, [px/s]

    Returns
    -------
    ndarray of int64, (n,)
    """
    n, m = known_beads.elapsed.size, detected.radii.size
    starts = np.zeros(n + 1, dtype=np.int64)
    costs = Costs(starts, np.empty(n * m, dtype=np.int64), np.empty(n * m))
    squares = np.empty(m)
    largest_cost = _write_link_costs(
        known_beads, detected, velocity_change, max_speed, False, squares, costs
    )
    if _detect_shaking(known_beads.elapsed, starts):
        largest_cost = _write_link_costs(
            known_beads, detected, velocity_change, max_speed, True, squares, costs
        )
    # Any link within reach costs less than none.
    return assign(costs, m, largest_cost + 1.0)


@kernel
def _detect_shaking(elapsed: NDArray[np.float64], starts: NDArray[np.int64]) -> bool:
    """Whether too many of the beads detected in the last frame have no possible link."""
    shortest = np.inf
    for i in range(elapsed.size):
        shortest = min(shortest, elapsed[i])
    recent, lost = 0, 0
    for i in range(elapsed.size):
        if elapsed[i] <= 1.5 * shortest:
            recent += 1
            lost += starts[i] == starts[i + 1]
    return bool(lost > _MAX_LOST_SHARE * recent)


@kernel
def _write_link_costs(
    known_beads: KnownBeads,
    detected: DetectedBeads,
    velocity_change: float,
    max_speed: float,
    is_shaken: bool,
    squares: NDArray[np.float64],
    costs: Costs,
) -> float:
    """Write minus the log-likelihood of every possible link.

    Parameters
    ----------
    known_beads, detected, velocity_change, max_speed
        See `link_detections`.
    is_shaken : bool
        Whether beads may have any speed up to `max_speed`.
    squares : ndarray (m,)
        Work space.
    costs : Costs
        Written.

    Returns
    -------
    float
        The largest cost; -1 without a link.
    """
    largest_error = 0.0
    for j in range(detected.errors.size):
        largest_error = max(largest_error, detected.errors[j])
    largest_cost, count = -math.inf, 0
    for i in range(known_beads.elapsed.size):
        dt, variance, radius = (
            known_beads.elapsed[i],
            known_beads.variances[i],
            known_beads.expected_radii[i],
        )
        reach = max_speed * dt
        max_square = _MAX_SQUARED_SIGMAS * (
            variance + largest_error * largest_error + (velocity_change * dt) ** 2
        )
        max_square = max(max_square, radius * radius)
        if is_shaken:
            max_square = max(max_square, reach * reach)
        x, y = known_beads.predicted[i, 0], known_beads.predicted[i, 1]
        # Most are far away: no branch in this loop, so that it is vectorised.
        for j in range(squares.size):
            dx, dy = detected.positions[j, 0] - x, detected.positions[j, 1] - y
            squares[j] = dx * dx + dy * dy
        first, lowest = count, math.inf
        for j in range(squares.size):
            if squares[j] > max_square:
                continue
            cost = _link_cost(
                known_beads, detected, (i, j), squares[j], velocity_change * dt, reach, is_shaken
            )
            if cost < math.inf:
                costs.columns[count], costs.values[count] = j, cost
                lowest = min(lowest, cost)
                count += 1
        # Links that are much less likely than the best would let a hidden bead displace others.
        max_cost = lowest + _MAX_COST_DIFFERENCE
        end, count = count, first
        for k in range(first, end):
            if costs.values[k] <= max_cost:
                costs.columns[count], costs.values[count] = costs.columns[k], costs.values[k]
                largest_cost = max(largest_cost, costs.values[k])
                count += 1
        costs.starts[i + 1] = count
    return largest_cost if count else -1.0


@inlined
def _link_cost(
    known_beads: KnownBeads,
    detected: DetectedBeads,
    pair: tuple[int, int],
    square: float,
    deflection: float,
    reach: float,
    is_shaken: bool,
) -> float:
    """Cost of one link, apart by the square root of `square`; infinite out of reach."""
    i, j = pair
    radius = known_beads.expected_radii[i]
    variance = known_beads.variances[i] + detected.errors[j] * detected.errors[j]
    # The collision may have been at any time since: at the middle on average.
    collision_dx = detected.positions[j, 0] - 0.5 * (
        known_beads.predicted[i, 0] + known_beads.last_positions[i, 0]
    )
    collision_dy = detected.positions[j, 1] - 0.5 * (
        known_beads.predicted[i, 1] + known_beads.last_positions[i, 1]
    )
    collision_square = collision_dx * collision_dx + collision_dy * collision_dy
    collision_variance = variance + _COLLISION_VARIANCE_FACTOR * deflection**2
    outlier_variance = variance + (_OUTLIER_RADII * radius) ** 2
    shaken_variance = variance + (0.4 * reach) ** 2
    is_near = (
        collision_square <= _MAX_SQUARED_SIGMAS * collision_variance or square <= radius * radius
    )
    if not is_near and not (is_shaken and square <= reach * reach):
        return math.inf
    likelihood = (1.0 - _COLLISION_SHARE) / variance * math.exp(-0.5 * square / variance)
    likelihood += (
        _COLLISION_SHARE
        / collision_variance
        * math.exp(-0.5 * collision_square / collision_variance)
    )
    likelihood += _OUTLIER_SHARE / outlier_variance * math.exp(-0.5 * square / outlier_variance)
    likelihood += _SHAKEN_SHARE / shaken_variance * math.exp(-0.5 * square / shaken_variance)
    radius_residual = detected.radii[j] - radius
    radius_variance = (
        RADIUS_NOISE_PX * RADIUS_NOISE_PX + detected.radius_errors[j] * detected.radius_errors[j]
    )
    radius_cost = 0.5 * radius_residual * radius_residual / radius_variance
    return float(min(radius_cost, _MAX_RADIUS_COST) - math.log(likelihood))
