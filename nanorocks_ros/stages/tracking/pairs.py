"""Where beads should be, and how likely each of those seen is each of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.stages.tracking.flight import extend_flight

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE_JITTER_PX = 0.3
"""Of the size of a bead from picture to picture, beyond what its errors say, [px]."""
SLOWEST_PX_S = 6.0
"""Slowest change of velocity in a collision that is reckoned with, [px/s]."""

# Shares of the beads that collide, or are shaken, between two pictures.
_COLLIDING, _SHAKEN = 0.15, 0.002
# Share of the places that are off by more than their error says, and by how much, in radii:
# within its radius there is no other bead to confuse one with, unless above or below it.
_MISPLACED, _MISPLACED_BY = 0.02, 0.4
# Usual changes of velocity in a collision, squared, that are the limit.
_REACH2 = 16.0
_LARGEST_SIZE_COST = 6.0
# Of the variance of a change of velocity, what is left when the place is looked for half way
# between where the bead was and where it would be: its velocity is lost, and no more.
_HALF_WAY = 0.5
# A pair that is so much less likely than the best, as a logarithm, is none.
_WORTH = 10.0


@compiled
def pair_costs(
    predicted: NDArray[np.float64],
    variances: NDArray[np.float64],
    last: NDArray[np.float64],
    waits: NDArray[np.float64],
    sizes: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    radius_errors: NDArray[np.float64],
    collided: float,
    fastest: float,
    shaken_now: bool,
    costs: NDArray[np.float64],
) -> None:
    """Minus the logarithm of the likelihood of every pair; infinite out of reach.

    Parameters
    ----------
    predicted, variances : ndarrays (n, 2), (n,), [px], [px^2]
    last : ndarray (n, 2), [px]
        Where the beads were seen last.
    waits : ndarray (n,), [s]
        Since each track was seen.
    sizes, radii, radius_errors : ndarrays (n,), (m,), (m,), [px]
    places, errors : ndarrays (m, 2), (m,), [px]
    collided : float, [px/s]
        Usual change of a component of the velocity in a collision.
    fastest : float, [px/s]
    shaken_now : bool
        Whether beads may have got any speed since the last picture.
    costs : ndarray (n, m)
        Written.
    """
    worst = errors.max() if errors.size else 0.0
    for i in range(predicted.shape[0]):
        reach = fastest * waits[i]
        far = _REACH2 * (variances[i] + worst * worst + (collided * waits[i]) ** 2)
        far = max(far, sizes[i] * sizes[i])
        if shaken_now:
            far = max(far, reach * reach)
        for j in range(places.shape[0]):
            costs[i, j] = math.inf
            dx = places[j, 0] - predicted[i, 0]
            dy = places[j, 1] - predicted[i, 1]
            d2 = dx * dx + dy * dy
            if d2 > far:
                continue
            free = variances[i] + errors[j] * errors[j]
            # The collision may have been at any time since: on average half way.
            ax = places[j, 0] - 0.5 * (predicted[i, 0] + last[i, 0])
            ay = places[j, 1] - 0.5 * (predicted[i, 1] + last[i, 1])
            a2 = ax * ax + ay * ay
            hit = free + _HALF_WAY * (collided * waits[i]) ** 2
            missed = free + (_MISPLACED_BY * sizes[i]) ** 2
            shaken = free + (0.4 * reach) ** 2
            near = a2 <= _REACH2 * hit or d2 <= sizes[i] * sizes[i]
            if not near and not (shaken_now and d2 <= reach * reach):
                continue
            likelihood = (1.0 - _COLLIDING) / free * math.exp(-0.5 * d2 / free)
            likelihood += _COLLIDING / hit * math.exp(-0.5 * a2 / hit)
            likelihood += _MISPLACED / missed * math.exp(-0.5 * d2 / missed)
            likelihood += _SHAKEN / shaken * math.exp(-0.5 * d2 / shaken)
            off = radii[j] - sizes[i]
            usual = SIZE_JITTER_PX * SIZE_JITTER_PX + radius_errors[j] * radius_errors[j]
            size = 0.5 * off * off / usual
            costs[i, j] = min(size, _LARGEST_SIZE_COST) - math.log(likelihood)
        if places.shape[0]:
            # A bead that is hidden must not push the others from their places.
            most = costs[i].min() + _WORTH
            for j in range(places.shape[0]):
                if costs[i, j] > most:
                    costs[i, j] = math.inf


@compiled
def most_finite(costs: NDArray[np.float64]) -> float:
    """The largest cost of a pair that is possible; -1 when none is."""
    most, found = -math.inf, False
    for i in range(costs.shape[0]):
        for j in range(costs.shape[1]):
            if costs[i, j] < math.inf:
                most, found = max(most, costs[i, j]), True
    return most if found else -1.0


@compiled
def count_lost(costs: NDArray[np.float64], fresh: NDArray[np.bool_]) -> int:
    """How many of some tracks have no pair that is possible."""
    lost = 0
    for i in range(costs.shape[0]):
        if fresh[i]:
            lost += not (costs[i] < math.inf).any()
    return lost


@compiled
def predict(
    lines: NDArray[np.float64],
    radii: NDArray[np.float64],
    time: float,
    near_wall: NDArray[np.float64],
    far_wall: NDArray[np.float64],
    places: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> None:
    """Where lines lead, (n, 2), and the variance of a coordinate, (n,); walls reflect."""
    for i in range(lines.shape[0]):
        after = time - lines[i, 0]
        moving = lines[i, 6] < math.inf
        spread = lines[i, 6] if moving else SLOWEST_PX_S * SLOWEST_PX_S
        variances[i] = lines[i, 5] + spread * after * after
        for axis in range(2):
            place = lines[i, 1 + axis] + (lines[i, 3 + axis] * after if moving else 0.0)
            low, high = near_wall[axis] + radii[i], far_wall[axis] - radii[i]
            # A bead may be a little beyond where its wall should be.
            if high > low and not low - 1.0 <= place <= high + 1.0:
                room = high - low
                place = low + abs((place - low + room) % (2.0 * room) - room)
            places[i, axis] = place


@compiled
def extend_all(
    chosen: NDArray[np.int64],
    times: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    counts: NDArray[np.int64],
    lines: NDArray[np.float64],
    time: float,
    found: NDArray[np.float64],
    found_errors: NDArray[np.float64],
    window: float,
) -> None:
    """Add to each track the place chosen for it, if any; see `extend_flight`."""
    for i in range(chosen.size):
        j = chosen[i]
        if j >= 0:
            counts[i] = extend_flight(
                times[i],
                places[i],
                errors[i],
                counts[i],
                lines[i],
                time,
                found[j, 0],
                found[j, 1],
                found_errors[j],
                window,
            )


@compiled
def in_view(
    shown: NDArray[np.bool_],
    last: NDArray[np.float64],
    last_places: NDArray[np.float64],
    last_errors: NDArray[np.float64],
    lines: NDArray[np.float64],
    radii: NDArray[np.float64],
    radius_errors: NDArray[np.float64],
    predicted: NDArray[np.float64],
    variances: NDArray[np.float64],
    time: float,
    systematic: float,
    collisions: tuple[float, float],
) -> tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.bool_],
]:
    """Fields of `InView` but the first, of those that are shown.

    Parameters
    ----------
    shown : ndarray of bool, (n,)
    last : ndarray (n,), [s]
        When each was seen last, with the place first in `last_places` and `last_errors`.
    lines : ndarray (n, 9)
        Of `fit_flight`.
    radii, radius_errors : ndarray (n,), [px]
    predicted, variances : ndarrays (n, 2), (n,)
        Of `predict`.
    time : float, [s]
    systematic : float, [px]
        Error of all places of a bead together.
    collisions : tuple of 2 floats, [1/s], [px/s]
        How often a bead collides, and how much that changes its velocity.
    """
    n = np.count_nonzero(shown)
    places, errors, velocities = np.empty((n, 2)), np.empty(n), np.empty((n, 2))
    velocity_errors, seen = np.empty(n), np.empty(n, dtype=np.bool_)
    rate, kick = collisions
    row = 0
    for k in range(shown.size):
        if not shown[k]:
            continue
        seen[row] = last[k] == time
        if seen[row]:
            places[row], error = last_places[k, 0], last_errors[k, 0]
        else:
            # By collisions that nobody saw; on average one was half way.
            wait = time - last[k]
            strayed = min(rate * wait, 1.0) * (kick * wait) * (kick * wait) / 3.0
            places[row], error = predicted[k], math.sqrt(variances[k] + strayed)
        errors[row] = math.sqrt(error * error + systematic * systematic)
        known = abs(lines[k, 6]) < math.inf
        for axis in range(2):
            velocities[row, axis] = lines[k, 3 + axis] if known else np.nan
        velocity_errors[row] = math.sqrt(lines[k, 6]) if known else np.nan
        row += 1
    return (
        places,
        errors,
        velocities,
        velocity_errors,
        radii[shown],
        radius_errors[shown],
        seen,
    )
