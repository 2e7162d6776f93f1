"""Whether the restitution depends on the impact speed, from contacts at many speeds.

The local law 1 - restitution = loss (v / v_ref)^exponent has two unknowns, the restitution at the
reference speed and the exponent.

Tested by ``test/inference/contacts/test_restitution_exponent.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.dragged_contacts import FRICTION_FACTOR, FRICTION_SPREAD
from nanorocks_ros.inference.contacts.impact_likelihoods import CollisionImpacts, ReboundImpacts
from nanorocks_ros.inference.contacts.impact_tables import (
    FRICTION_LENGTH,
    LOSS_COLUMNS,
)
from nanorocks_ros.inference.contacts.restitution_law import law_posterior
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import Interval, Measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.impact_likelihoods import Impacts
    from nanorocks_ros.inference.contacts.restitution_law import RestitutionLaw
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
# Part of the median speed below which a speed is next to nothing: its logarithm says nothing.
_NEXT_TO_NOTHING = 0.02
# Part of what friction takes off beside contacts that may go with the logarithm of speed: beads
# roll and rub at each other. With a friction of 0.03 exponents come out 0.1 too high.
_RUBBING_ERROR = 0.5


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
    law : RestitutionLaw
        Both together.
    """

    contacts: int
    speed: float
    restitution: float
    exponent: Posterior1D
    law: RestitutionLaw

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

    def law_probability(self, highest: float) -> float:
        """Probability of a law against a constant restitution; before, they are equally likely.

        Parameters
        ----------
        highest : float, > 0
            Exponent up to which that of the law may be, flat from 0 on. The ratio of the evidence
            of both is that of its densities at 0 before and after (Savage, Dickey).
        """
        axis, probability = self.exponent.restitution, self.exponent.probability
        inside = float(probability[(axis >= 0.0) & (axis <= highest)].sum())
        if not inside > 0.0:
            return 0.0
        density = float(np.interp(0.0, axis, probability, 0.0, 0.0)) / float(axis[1] - axis[0])
        return 1.0 / (1.0 + highest * density / inside)


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
    return _exponent(ReboundImpacts(impacts, scale), slowing, bias)


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
    return _exponent(CollisionImpacts(impacts), slowing, bias)


def _exponent(impacts: Impacts, slowing: Slowing, bias: float) -> RestitutionExponent | None:
    speeds = impacts.speeds
    if len(speeds) < MIN_CONTACTS:
        return None
    impacts = impacts.part(np.flatnonzero(speeds > _NEXT_TO_NOTHING * np.median(speeds)))
    contacts = len(impacts.rows)
    kept = kept_beside_contacts(impacts, slowing)
    rubbed = FRICTION_FACTOR * float(slowing.values[1] * impacts.rows[:, FRICTION_LENGTH].mean())
    slope_bias = math.hypot(bias, _RUBBING_ERROR * rubbed)
    restitutions = _likely_restitutions(impacts, kept.mean(axis=0))
    by_slowing = [impacts.logs(part, restitutions, EXPONENTS) for part in kept]
    logs = log_sum(np.array(by_slowing).reshape(len(kept), -1)).reshape(by_slowing[0].shape)
    best = float(restitutions[np.argmax(logs.max(axis=1))])
    term = Likelihood1D(restitution=EXPONENTS, log_likelihood=log_sum(logs))
    exponent_bias = slope_bias / max(1.0 - best, slope_bias)
    return RestitutionExponent(
        contacts=contacts,
        speed=impacts.reference,
        restitution=best,
        exponent=term.convolved(exponent_bias).posterior(
            (float(EXPONENTS[0]), float(EXPONENTS[-1]))
        ),
        law=law_posterior((restitutions, EXPONENTS), logs, impacts, (bias, exponent_bias)),
    )


def _likely_restitutions(impacts: Impacts, kept: NDArray[np.float64]) -> NDArray[np.float64]:
    """Restitutions at the reference speed that are likely with some exponent."""
    grid = np.linspace(0.0, _MAX_RESTITUTION, _STEPS)
    for _ in range(_ROUNDS):
        logs = impacts.logs(kept, grid, _FEW).max(axis=1)
        likely = np.flatnonzero(logs > logs.max() - _DEPTH)
        first, last = max(likely[0] - 1, 0), min(likely[-1] + 1, _STEPS - 1)
        grid = np.linspace(grid[first], grid[last], _STEPS)
    return grid


def kept_beside_contacts(impacts: Impacts, slowing: Slowing) -> NDArray[np.float64]:
    """Part of the restitution that is left in the measured speeds, (k, n).

    For k equally likely cases, which have the mean and the covariance of what is known of drag and
    friction beside a contact and of the speed that slow contacts seem to lose.
    """
    time, length, taken_out = impacts.rows[:, :LOSS_COLUMNS].T
    slowest = _NEXT_TO_NOTHING * np.median(impacts.speeds)
    speeds = np.maximum(impacts.speeds, slowest)
    reach = np.column_stack([time, FRICTION_FACTOR * length, 1.0 / speeds])
    covariance = np.zeros((3, 3))
    covariance[:2, :2], covariance[2, 2] = slowing.covariance, _SLOW_LOSS.error**2
    covariance[1, 1] += (FRICTION_SPREAD * slowing.values[1]) ** 2
    squares, axes = np.linalg.eigh(covariance)
    known = squares > 0.0
    steps = np.sqrt(known.sum() * squares[known])[:, np.newaxis] * axes.T[known]
    cases = np.append(slowing.values, _SLOW_LOSS.value) + np.concatenate([steps, -steps])
    kept: NDArray[np.float64] = np.exp(time * taken_out - cases @ reach.T)
    return kept
