"""Likelihood of the wall restitution where floor and lid rub: losses of single rebounds.

A bead that bounces between floor and lid hits them unseen beside a rebound, too. Each hit takes
friction times the change of the vertical speed off the speed along them, so that a rebound loses
nothing, or one or more such steps: the scatter of rebounds is one-sided. Vertical speeds are taken
to be Gaussian, with the mean square of a horizontal component; the time of a hit is uniform.

Friction and drag slow the flights together: a friction that is tried leaves the drag that the
flights then tell, so that no loss counts twice.

Tested by ``test/inference/contacts/test_rubbed_rebounds.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from nanorocks_ros.inference.contacts.contact_likelihood import ERROR_SCALES, OUTLIERS, marginal
from nanorocks_ros.inference.contacts.impact_tables import (
    DRAG,
    DRAG_TIME,
    DRAG_TIME_AFTER,
    DRAG_TIME_BEFORE,
    FRICTION_LENGTH,
    HITS_AFTER,
    HITS_BEFORE,
    INCOMING,
    INCOMING_ERROR,
    OUTGOING,
    OUTGOING_ERROR,
    VERTICAL_AFTER,
    VERTICAL_BEFORE,
    WALL_ERROR,
)
from nanorocks_ros.inference.contacts.projected_collisions import RANGE
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.log_sums import log_sum

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.flights.flight_losses import Slowing

# Change of the vertical speed at a hit over the speed before it: 1 and a restitution.
_CHANGE = 1.95
ROLLING, SLIDING = 0.4, 1.0
"""Shares of the full loss that hits take off: beads that roll lose less, and a hit that shows
ends a flight. With friction and drag known walls come out right with 0.2 to 0.6
(`benchmarks.drawn_friction`)."""
# Relative spread of the share in the friction rate of the flights.
_SHARE_SPREAD = 0.5
# Vertical speeds, in steps of a part of their root mean square, and equally likely times of a hit.
_SPEEDS, _STEP, _PHASES = 10, 0.3, 6
_GOLDEN = 0.618034
# Parts of a speed are alike within this, in errors of the speed after; and the least that is left.
_ALIKE, _LEAST = 0.25, 0.01
# Restitutions of a likelihood, and frictions between which it is interpolated.
_WALLS = np.linspace(0.5, 1.0, 251)
_FRICTIONS = np.array([0.0, 0.004, 0.008, 0.015, 0.025, 0.04, 0.065, 0.1, 0.15])
# Errors of equally likely drags from their mean, of unit variance: few, and many for drags whose
# error times the drag time of rebounds is above this.
_FEW_DRAGS = math.sqrt(1.5) * np.array([-1.0, 0.0, 1.0])
_MANY_DRAGS = ndtri((np.arange(9) + 0.5) / 9.0)
_MANY_DRAGS /= _MANY_DRAGS.std()
_FAINT = 0.01
# Frictions less probable than this, over the largest probability, are left out.
_UNLIKELY = 1e-6
# Errors beyond which a Gaussian is 0.
_FARTHEST = 6.0
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


def rubbed_likelihood(
    impacts: NDArray[np.float64],
    slowing: Slowing,
    friction: tuple[NDArray[np.float64], NDArray[np.float64]],
    share: float = ROLLING,
) -> Likelihood1D:
    """Log likelihood of rebounds, with friction, drag and the scale of errors integrated over.

    Parameters
    ----------
    impacts : ndarray (n, REBOUND_COLUMNS)
        From `rebound_impacts`.
    slowing : Slowing
        Drag and friction rate as flights tell them; a gas slows beads, whatever they tell.
    friction : tuple of 2 ndarrays (n,)
        Frictions of floor and lid, and their probabilities.
    share : float
        Of the full loss that hits take off.
    """
    places = np.interp(friction[0], _FRICTIONS, np.arange(_FRICTIONS.size))
    below = np.minimum(places.astype(int), _FRICTIONS.size - 2)
    weights = np.bincount(below, friction[1] * (1.0 + below - places), _FRICTIONS.size)
    weights += np.bincount(below + 1, friction[1] * (places - below), _FRICTIONS.size)
    rates = share * _CHANGE * _FRICTIONS / _free_height(impacts)
    beside = [slowing.beside_friction(rate, _SHARE_SPREAD * rate) for rate in rates.tolist()]
    logs = np.array([log_likelihood for _, log_likelihood in beside])
    weights = weights * np.exp(logs - logs.max())
    weights /= weights.sum()
    drag_time = float(np.mean(impacts[:, DRAG_TIME]))
    by_friction, likely = [], np.flatnonzero(weights > _UNLIKELY * weights.max())
    for k in likely.tolist():
        drag = beside[k][0]
        errors = _FEW_DRAGS if drag.error * drag_time < _FAINT else _MANY_DRAGS
        drags = np.maximum(drag.value + drag.error * errors, 0.0)
        table = rubbed_table(impacts, _WALLS, share * _FRICTIONS[k : k + 1], drags)
        by_friction.append(marginal(table.reshape(-1, _WALLS.size)))
    logs = log_sum(np.array(by_friction), weights[likely])
    return Likelihood1D(restitution=_WALLS, log_likelihood=logs)


def _free_height(impacts: NDArray[np.float64]) -> float:
    """Way of beads from floor to lid, [m]; infinite where they meet neither."""
    hits = impacts[:, HITS_BEFORE] + impacts[:, HITS_AFTER]
    meets = (hits > 0.0) & (impacts[:, VERTICAL_AFTER] > 0.0)
    if not meets.any():
        return math.inf
    ways = impacts[meets, FRICTION_LENGTH] * (
        1.0 / impacts[meets, VERTICAL_BEFORE] + 1.0 / impacts[meets, VERTICAL_AFTER]
    )
    return float(np.median(ways / hits[meets]))


def rubbed_table(
    impacts: NDArray[np.float64],
    grid: NDArray[np.float64],
    frictions: NDArray[np.float64],
    drags: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Log likelihood of rebounds for each friction, drag, scale of errors and restitution.

    Parameters
    ----------
    impacts : ndarray (n, REBOUND_COLUMNS)
        From `rebound_impacts`.
    grid : ndarray (n_grid,)
        Restitutions of the side walls, rising.
    frictions : ndarray (n_frictions,)
        Coefficients of friction of floor and lid, as hits act beside a rebound.
    drags : ndarray (n_drags,), [1/s]
        Of the gas, for the first species.

    Returns
    -------
    ndarray (n_frictions, n_drags, n_scales, n_grid)
        Up to a constant; 0 without rebounds.
    """
    scales = np.array(ERROR_SCALES)
    table = np.zeros((frictions.size, drags.size, scales.size, grid.size))
    for impact in impacts:
        _add_rebound(impact, grid, (frictions, drags, scales), table)
    return table


_VERTICAL = _STEP * (np.arange(_SPEEDS) + 0.5)
_SHARES = np.exp(-0.5 * _VERTICAL**2)
_SHARES /= _SHARES.sum() * _PHASES


@compiled
def _add_rebound(
    impact: NDArray[np.float64],
    grid: NDArray[np.float64],
    axes: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    table: NDArray[np.float64],
) -> None:
    """Add the log likelihood of a rebound to the table of `rubbed_table`."""
    frictions, drags, scales = axes
    remains, weights = np.empty(_SPEEDS * _PHASES), np.empty(_SPEEDS * _PHASES)
    errors, density = np.empty(grid.size), np.empty((scales.size, grid.size))
    for n in range(grid.size):
        own, wall = grid[n] * impact[INCOMING_ERROR], (1.0 + grid[n]) * impact[WALL_ERROR]
        errors[n] = math.sqrt(own * own + impact[OUTGOING_ERROR] ** 2 + wall * wall)
    for i in range(frictions.size):
        nodes = _remaining_speeds(impact, _CHANGE * frictions[i], remains, weights)
        for j in range(drags.size):
            extra = drags[j] - impact[DRAG]
            before = impact[INCOMING] * math.exp(-extra * impact[DRAG_TIME_BEFORE])
            after = impact[OUTGOING] * math.exp(extra * impact[DRAG_TIME_AFTER])
            density[:] = OUTLIERS / (RANGE * impact[INCOMING])
            for node in range(nodes):
                speeds = before * remains[node], after
                _add_density(
                    speeds, (1.0 - OUTLIERS) * weights[node], grid, errors, scales, density
                )
            for k in range(scales.size):
                for n in range(grid.size):
                    table[i, j, k, n] += math.log(density[k, n])


@compiled
def _add_density(
    speeds: tuple[float, float],
    weight: float,
    grid: NDArray[np.float64],
    errors: NDArray[np.float64],
    scales: NDArray[np.float64],
    density: NDArray[np.float64],
) -> None:
    """Add the density of a speed after a rebound, given that before and what hits left of it."""
    before, after = speeds
    for k in range(scales.size):
        # Errors rise with the restitution.
        reach = _FARTHEST * scales[k] * errors[-1]
        first = np.searchsorted(grid, (after - reach) / before)
        last = np.searchsorted(grid, (after + reach) / before)
        for n in range(first, last):
            error = scales[k] * errors[n]
            off = (after - grid[n] * before) / error
            density[k, n] += weight / (_SQRT_2_PI * error) * math.exp(-0.5 * off * off)


@compiled
def _remaining_speeds(
    impact: NDArray[np.float64],
    friction: float,
    remains: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> int:
    """Write the parts of a speed that hits beside a rebound leave, and their probabilities.

    `friction` is what a hit takes off, over the vertical speed. Returns the number of parts; parts
    that differ by much less than the errors are one.
    """
    alike, nodes = _ALIKE * impact[OUTGOING_ERROR] / impact[OUTGOING], 0
    for k in range(_SPEEDS):
        speed = _VERTICAL[k]
        for phase in range(_PHASES):
            # Shifted from speed to speed, so that few losses are alike.
            first = (phase + (_GOLDEN * (k + 1)) % 1.0) / _PHASES
            hits = _hits(first / speed, 1.0 / speed, impact[HITS_BEFORE])
            part = max(1.0 - friction * speed * impact[VERTICAL_BEFORE] * hits, _LEAST)
            hits = _hits((1.0 - first) / speed, 1.0 / speed, impact[HITS_AFTER])
            part /= 1.0 + friction * speed * impact[VERTICAL_AFTER] * hits
            node = 0
            while node < nodes and abs(part - remains[node]) > alike:
                node += 1
            if node == nodes:
                remains[node], weights[node], nodes = part, 0.0, nodes + 1
            weights[node] += _SHARES[k]
            remains[node] += (part - remains[node]) * _SHARES[k] / weights[node]
    return nodes


@compiled
def _hits(first: float, spacing: float, end: float) -> float:
    """Sum of the effects of hits, at even distances from a rebound, on the slope of a flight.

    A hit beside the rebound changes the line through the flight like its speed at the rebound, one
    at the far end does not change it.
    """
    total, place = 0.0, first
    while place < end:
        x = place / end
        total += 1.0 - x * x * (3.0 - 2.0 * x)
        place += spacing
    return total
