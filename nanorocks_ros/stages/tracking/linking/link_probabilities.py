"""How likely each of the beads that are seen is each of those that are known."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.linking.assignment import Costs, assign

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
# Share of the beads that must be out of reach of collisions for a tray to have been shaken.
_LOST = 0.3
# A pair that is so much less likely than the best, as a logarithm, is none.
_WORTH = 10.0


class Known(NamedTuple):
    """Beads that are followed.

    Parameters
    ----------
    predicted, variances : ndarrays (n, 2), (n,), [px], [px^2]
        Where they should be, and the variance of a coordinate.
    last : ndarray (n, 2), [px]
        Where they were seen last.
    waits : ndarray (n,), [s]
        Since then.
    sizes : ndarray (n,), [px]
        Radii.
    """

    predicted: NDArray[np.float64]
    variances: NDArray[np.float64]
    last: NDArray[np.float64]
    waits: NDArray[np.float64]
    sizes: NDArray[np.float64]


class Seen(NamedTuple):
    """Beads in a picture: places (m, 2), errors of a coordinate, radii and their errors, [px]."""

    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]


@compiled
def pair_up(known: Known, seen: Seen, collided: float, fastest: float) -> NDArray[np.int64]:
    """Which of the beads that are seen is each of those known, or -1.

    Any bead may collide, but when many are not where even a collision could have sent them, the
    tray was shaken.

    Parameters
    ----------
    known, seen : Known, Seen
    collided : float, [px/s]
        Usual change of a component of the velocity in a collision.
    fastest : float, [px/s]

    Returns
    -------
    ndarray of int64, (n,)
    """
    n, m = known.waits.size, seen.radii.size
    starts = np.zeros(n + 1, dtype=np.int64)
    costs = Costs(starts, np.empty(n * m, dtype=np.int64), np.empty(n * m))
    squares = np.empty(m)
    most = _pair_costs(known, seen, collided, fastest, False, squares, costs)
    if _shaken(known.waits, starts):
        most = _pair_costs(known, seen, collided, fastest, True, squares, costs)
    # Any pair within reach is better than none.
    return assign(costs, m, most + 1.0)


@kernel
def _shaken(waits: NDArray[np.float64], starts: NDArray[np.int64]) -> bool:
    """Whether too many of the beads that were seen in the last picture have no pair."""
    latest = np.inf
    for i in range(waits.size):
        latest = min(latest, waits[i])
    fresh, lost = 0, 0
    for i in range(waits.size):
        if waits[i] <= 1.5 * latest:
            fresh += 1
            lost += starts[i] == starts[i + 1]
    return bool(lost > _LOST * fresh)


@kernel
def _pair_costs(
    known: Known,
    seen: Seen,
    collided: float,
    fastest: float,
    shaken_now: bool,
    squares: NDArray[np.float64],
    costs: Costs,
) -> float:
    """Write minus the logarithm of the likelihood of every pair within reach.

    Parameters
    ----------
    known, seen, collided, fastest
        See `pair_up`.
    shaken_now : bool
        Whether beads may have got any speed since the last picture.
    squares : ndarray (m,)
        Room.
    costs : Costs
        Written.

    Returns
    -------
    float
        The largest cost; -1 when there is no pair.
    """
    worst = 0.0
    for j in range(seen.errors.size):
        worst = max(worst, seen.errors[j])
    largest, count = -math.inf, 0
    for i in range(known.waits.size):
        wait, variance, size = known.waits[i], known.variances[i], known.sizes[i]
        reach = fastest * wait
        far = _REACH2 * (variance + worst * worst + (collided * wait) ** 2)
        far = max(far, size * size)
        if shaken_now:
            far = max(far, reach * reach)
        x, y = known.predicted[i, 0], known.predicted[i, 1]
        # Most are far: many at once, without a choice.
        for j in range(squares.size):
            dx, dy = seen.places[j, 0] - x, seen.places[j, 1] - y
            squares[j] = dx * dx + dy * dy
        first, least = count, math.inf
        for j in range(squares.size):
            if squares[j] > far:
                continue
            cost = _cost(known, seen, (i, j), squares[j], collided * wait, reach, shaken_now)
            if cost < math.inf:
                costs.columns[count], costs.values[count] = j, cost
                least = min(least, cost)
                count += 1
        # A bead that is hidden must not push the others from their places.
        most = least + _WORTH
        last, count = count, first
        for k in range(first, last):
            if costs.values[k] <= most:
                costs.columns[count], costs.values[count] = costs.columns[k], costs.values[k]
                largest = max(largest, costs.values[k])
                count += 1
        costs.starts[i + 1] = count
    return largest if count else -1.0


@inlined
def _cost(
    known: Known,
    seen: Seen,
    pair: tuple[int, int],
    d2: float,
    kick: float,
    reach: float,
    shaken_now: bool,
) -> float:
    """Of one pair, apart by the square root of `d2`; infinite out of reach."""
    i, j = pair
    size = known.sizes[i]
    free = known.variances[i] + seen.errors[j] * seen.errors[j]
    # The collision may have been at any time since: on average half way.
    ax = seen.places[j, 0] - 0.5 * (known.predicted[i, 0] + known.last[i, 0])
    ay = seen.places[j, 1] - 0.5 * (known.predicted[i, 1] + known.last[i, 1])
    a2 = ax * ax + ay * ay
    hit = free + _HALF_WAY * kick**2
    missed = free + (_MISPLACED_BY * size) ** 2
    shaken = free + (0.4 * reach) ** 2
    near = a2 <= _REACH2 * hit or d2 <= size * size
    if not near and not (shaken_now and d2 <= reach * reach):
        return math.inf
    likelihood = (1.0 - _COLLIDING) / free * math.exp(-0.5 * d2 / free)
    likelihood += _COLLIDING / hit * math.exp(-0.5 * a2 / hit)
    likelihood += _MISPLACED / missed * math.exp(-0.5 * d2 / missed)
    likelihood += _SHAKEN / shaken * math.exp(-0.5 * d2 / shaken)
    off = seen.radii[j] - size
    usual = SIZE_JITTER_PX * SIZE_JITTER_PX + seen.radius_errors[j] * seen.radius_errors[j]
    unlike = 0.5 * off * off / usual
    return float(min(unlike, _LARGEST_SIZE_COST) - math.log(likelihood))
