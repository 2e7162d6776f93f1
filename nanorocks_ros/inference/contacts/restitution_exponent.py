"""Whether the restitution depends on the impact speed, from contacts at many speeds.

The local law 1 - restitution = loss (v / v_ref)^exponent has two unknowns, the restitution at the
reference speed and the exponent. About a contact the restitution follows the tangent of the law,
so that its likelihood stays in closed form.

Tested by ``test/inference/contacts/test_restitution_exponent.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import OUTLIERS
from nanorocks_ros.inference.contacts.dragged_contacts import FRICTION_FACTOR, FRICTION_SPREAD
from nanorocks_ros.inference.contacts.impact_tables import (
    FRICTION_LENGTH,
    INCOMING,
    INCOMING_ERROR,
    LOSS_COLUMNS,
    NODES,
    OUTGOING,
    OUTGOING_ERROR,
    WALL_ERROR,
)
from nanorocks_ros.inference.contacts.projected_collisions import RANGE
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import Interval, Measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.flights.flight_losses import Slowing
    from nanorocks_ros.inference.likelihood_1d import Posterior1D

MIN_CONTACTS = 20
"""Smallest number of contacts of a kind for an exponent."""
EXPONENTS = np.linspace(-1.0, 2.0, 31)
"""Exponents that are compared; all are equally likely."""

# Exponents for the search of the likely restitutions, how often and in how many steps the range is
# narrowed, and to which depth of the log likelihood. With 1 nothing would depend on speed.
_FEW, _ROUNDS, _STEPS, _DEPTH = np.array([-0.4, 0.0, 0.4, 0.8]), 4, 16, 12.0
_MAX_RESTITUTION = 0.999
# In films the speed after a contact came out this much too low, [m/s], whoever made them: contacts
# of less than 0.6 mm/s read 0.01 to 0.02 low, others hardly. In true tracks it is 0.
_SLOW_LOSS = Measured(4e-6, 4e-6)
# Exponents of simulated cycles by collisions scatter so much more than each collision by itself
# says: radii and vertical speeds are common to them.
_COLLISION_SCATTER = 1.3
# Part of what friction takes off beside contacts that may go with the logarithm of speed: beads
# roll and rub at each other. With a friction of 0.03 exponents come out 0.1 too high.
_RUBBING_ERROR = 0.5
# 1 + restitution of two beads, for the reference speed.
_MEAN_GAIN = 1.85
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class RestitutionExponent:
    """The local law of the restitution of one kind of contacts.

    Parameters
    ----------
    contacts : int
    speed : float, [m/s]
        Geometric mean of their normal impact speeds: the reference speed.
    restitution : float
        Most likely one at that speed.
    exponent : Posterior1D
        0: the restitution is constant.
    """

    contacts: int
    speed: float
    restitution: float
    exponent: Posterior1D

    def interval(self, ends: NDArray[np.float64]) -> Interval:
        """The exponent; `ends` are the probabilities of lower end, value and upper end."""
        lower, value, upper = self.exponent.quantiles(ends).tolist()
        return Interval(value, lower, upper)

    @property
    def chance(self) -> float:
        """Probability that a constant restitution shows an exponent at least as far from 0."""
        axis = self.exponent.restitution
        below = float(self.exponent.probability[axis < 0.0].sum())
        return 2.0 * min(below, 1.0 - below)


def wall_exponent(
    impacts: NDArray[np.float64], scale: float, slowing: Slowing, bias: float
) -> RestitutionExponent | None:
    """Exponent of the walls from rebounds; None where these are too few.

    Parameters
    ----------
    impacts : ndarray (n, REBOUND_COLUMNS)
        From `rebound_impacts`.
    scale : float
        Of their errors, of those of `rebound_table` the most likely.
    slowing : Slowing
        What slows beads between contacts.
    bias : float
        Standard deviation of a systematic error of the restitution that grows by this amount per
        factor e in speed.
    """
    return _exponent(_Rebounds(impacts, scale), slowing, bias)


def bead_exponent(
    impacts: NDArray[np.float32], slowing: Slowing, bias: float
) -> RestitutionExponent | None:
    """Exponent of the beads from collisions, as `wall_exponent`.

    Parameters
    ----------
    impacts : ndarray (n, COLLISION_COLUMNS)
        From `collision_impacts`.
    slowing : Slowing
    bias : float
    """
    return _exponent(_Collisions(impacts), slowing, bias)


class _Impacts(Protocol):
    """Contacts of one kind."""

    rows: NDArray[np.float64]

    @property
    def speeds(self) -> NDArray[np.float64]:
        """Impact speeds, (n,), [m/s]."""

    def logs(
        self,
        kept: NDArray[np.float64],
        reference: float,
        restitutions: NDArray[np.float64],
        exponents: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Log likelihood, (r, p), of restitutions at the reference speed and of exponents."""


class _Rebounds:
    def __init__(self, impacts: NDArray[np.float64], scale: float) -> None:
        self.rows = impacts.copy()
        self.rows[:, [INCOMING_ERROR, OUTGOING_ERROR, WALL_ERROR]] *= scale

    @property
    def speeds(self) -> NDArray[np.float64]:
        return self.rows[:, INCOMING]

    def logs(
        self,
        kept: NDArray[np.float64],
        reference: float,
        restitutions: NDArray[np.float64],
        exponents: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        return _rebound_logs(self.rows, kept, reference, restitutions, exponents)


class _Collisions:
    def __init__(self, impacts: NDArray[np.float32]) -> None:
        self.rows = impacts.astype(np.float64)

    @property
    def speeds(self) -> NDArray[np.float64]:
        return self.rows[:, LOSS_COLUMNS] / _MEAN_GAIN

    def logs(
        self,
        kept: NDArray[np.float64],
        reference: float,
        restitutions: NDArray[np.float64],
        exponents: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        logs = _collision_logs(self.rows, kept, reference, restitutions, exponents)
        return logs / _COLLISION_SCATTER**2


def _exponent(impacts: _Impacts, slowing: Slowing, bias: float) -> RestitutionExponent | None:
    contacts = len(impacts.rows)
    if contacts < MIN_CONTACTS:
        return None
    reference = math.exp(float(np.log(impacts.speeds).mean()))
    kept = _kept(impacts, slowing)
    rubbed = FRICTION_FACTOR * float(slowing.values[1] * impacts.rows[:, FRICTION_LENGTH].mean())
    bias = math.hypot(bias, _RUBBING_ERROR * rubbed)
    restitutions = _likely_restitutions(impacts, kept.mean(axis=0), reference)
    by_slowing = [impacts.logs(part, reference, restitutions, EXPONENTS) for part in kept]
    logs = log_sum(np.array(by_slowing).reshape(len(kept), -1)).reshape(by_slowing[0].shape)
    best = float(restitutions[np.argmax(logs.max(axis=1))])
    term = Likelihood1D(restitution=EXPONENTS, log_likelihood=log_sum(logs))
    return RestitutionExponent(
        contacts=contacts,
        speed=reference,
        restitution=best,
        exponent=term.convolved(bias / max(1.0 - best, bias)).posterior(
            (float(EXPONENTS[0]), float(EXPONENTS[-1]))
        ),
    )


def _likely_restitutions(
    impacts: _Impacts, kept: NDArray[np.float64], reference: float
) -> NDArray[np.float64]:
    """Restitutions at the reference speed that are likely with some exponent."""
    grid = np.linspace(0.0, _MAX_RESTITUTION, _STEPS)
    for _ in range(_ROUNDS):
        logs = impacts.logs(kept, reference, grid, _FEW).max(axis=1)
        likely = np.flatnonzero(logs > logs.max() - _DEPTH)
        first, last = max(likely[0] - 1, 0), min(likely[-1] + 1, _STEPS - 1)
        grid = np.linspace(grid[first], grid[last], _STEPS)
    return grid


def _kept(impacts: _Impacts, slowing: Slowing) -> NDArray[np.float64]:
    """Part of the restitution that is left in the measured speeds, (k, n).

    For k equally likely cases, which have the mean and the covariance of what is known of drag and
    friction beside a contact and of the speed that slow contacts seem to lose.
    """
    time, length, taken_out = impacts.rows[:, :LOSS_COLUMNS].T
    reach = np.column_stack([time, FRICTION_FACTOR * length, 1.0 / impacts.speeds])
    covariance = np.zeros((3, 3))
    covariance[:2, :2], covariance[2, 2] = slowing.covariance, _SLOW_LOSS.error**2
    covariance[1, 1] += (FRICTION_SPREAD * slowing.values[1]) ** 2
    squares, axes = np.linalg.eigh(covariance)
    known = squares > 0.0
    steps = np.sqrt(known.sum() * squares[known])[:, np.newaxis] * axes.T[known]
    cases = np.append(slowing.values, _SLOW_LOSS.value) + np.concatenate([steps, -steps])
    kept: NDArray[np.float64] = np.exp(time * taken_out - cases @ reach.T)
    return kept


@compiled
def _rebound_logs(
    rows: NDArray[np.float64],
    kept: NDArray[np.float64],
    reference: float,
    restitutions: NDArray[np.float64],
    exponents: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Log likelihood, (r, p), of rebounds."""
    table = np.zeros((restitutions.size, exponents.size))
    for i in range(rows.shape[0]):
        incoming, outgoing = rows[i, INCOMING], rows[i, OUTGOING]
        before, after = rows[i, INCOMING_ERROR], rows[i, OUTGOING_ERROR]
        wall = rows[i, WALL_ERROR]
        outlier = OUTLIERS / (RANGE * incoming)
        for k in range(exponents.size):
            power = (incoming / reference) ** exponents[k]
            for r in range(restitutions.size):
                loss = min((1.0 - restitutions[r]) * power, 1.0)
                value = kept[i] * (1.0 - loss)
                slope = value - kept[i] * exponents[k] * loss
                variance = (slope * before) ** 2 + after * after + ((1.0 + slope) * wall) ** 2
                square = (outgoing - value * incoming) ** 2 / variance
                height = (1.0 - OUTLIERS) / (_SQRT_2_PI * math.sqrt(variance))
                table[r, k] += math.log(height * math.exp(-0.5 * square) + outlier)
    return table


@compiled
def _collision_logs(
    rows: NDArray[np.float64],
    kept: NDArray[np.float64],
    reference: float,
    restitutions: NDArray[np.float64],
    exponents: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Log likelihood, (r, p), of collisions."""
    table = np.zeros((restitutions.size, exponents.size))
    for k in range(exponents.size):
        powers = (rows[:, LOSS_COLUMNS] / reference) ** exponents[k]
        for r in range(restitutions.size):
            mean = 1.0 - restitutions[r]
            unit = mean / (2.0 - mean) ** exponents[k]
            for i in range(rows.shape[0]):
                # Speed over 1 + restitution, first with that at the reference speed, then with
                # that of the contact, to second order.
                loss = min(unit * powers[i], 1.0)
                change = exponents[k] * (loss - mean) / (2.0 - 0.5 * (loss + mean))
                loss = min(unit * powers[i] * (1.0 + change + 0.5 * change * change), 1.0)
                place = min(kept[i] * (1.0 - loss), 1.0) * (NODES - 1)
                level = _between(rows, i, LOSS_COLUMNS + 1, place)
                slope = _between(rows, i, LOSS_COLUMNS + 1 + NODES, place)
                table[r, k] += level + exponents[k] * loss * slope
    return table


@inlined
def _between(rows: NDArray[np.float64], i: int, first: int, place: float) -> float:
    """Value between the nodes of a row from a column on, by a parabola through the nearest."""
    node = min(max(int(place + 0.5), 1), NODES - 2)
    part = place - node
    low, middle, high = (
        rows[i, first + node - 1],
        rows[i, first + node],
        rows[i, first + node + 1],
    )
    return float(middle + part * (0.5 * (high - low) + 0.5 * part * (high - 2.0 * middle + low)))
