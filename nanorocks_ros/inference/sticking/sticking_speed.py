"""Sticking speed from the times at which bodies merged: a Poisson likelihood.

Derived in docs/method/clusters.md; accuracy in docs/validation/sticking_accuracy.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import add
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import logsumexp

from nanorocks_ros.inference.sticking.merge_likelihood import MergeLikelihood, MergeRates
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import ONE_SIGMA, StickingStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
    from nanorocks_ros.physics.sticking_rates import SlowContacts

# Log of a factor of all rates, in standard deviations: nodes and weights of its normal law.
_NORMAL_NODES, _NORMAL_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)
# The same where each leaves a narrow range of speeds.
_CLOSE_NODES = np.linspace(-3.5, 3.5, 141)
_CLOSE_WEIGHTS = np.exp(-0.5 * _CLOSE_NODES**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingEstimate:
    """The sticking speed of some beads.

    Parameters
    ----------
    status : StickingStatus
    sticking_speed : float, [m/s]
        Median of the posterior; NaN unless measured.
    lower, upper : float, [m/s]
        Interval. Without a merge it runs from 0 to an upper limit, which is NaN where any speed
        fits; if all colliding bodies stuck, from a lower limit to the highest speed of the grid.
    lower_68, upper_68 : float, [m/s]
        The same with the probability `ONE_SIGMA`.
    merges : int
    probability : float, 0 to 1
        Of `lower` and `upper`.
    """

    status: StickingStatus
    sticking_speed: float
    lower: float
    upper: float
    lower_68: float
    upper_68: float
    merges: int
    probability: float


def sticking_estimate(
    cycles: Sequence[StickingCycle],
    contacts: SlowContacts,
    beads: int,
    *,
    measure: str = 'normal',
    highest: float = 0.03,
    least_share: float = 0.3,
    rate_error: float = 0.25,
    probability: float = 0.95,
) -> StickingEstimate:
    """Sticking speed from the merges of bodies, with a flat prior up to `highest`.

    Parameters
    ----------
    cycles : sequence of StickingCycle
        One or more independent cycles.
    contacts, beads, measure, highest, least_share
        See `MergeRates`.
    rate_error, probability : float
        See `sticking_estimate_of`.

    Raises
    ------
    ConfigurationError
        For an unknown measure.
    FitError
        For speeds or times that cannot be used.
    """
    rates = MergeRates(contacts, beads, measure, highest=highest, least_share=least_share)
    terms = reduce(add, [rates.terms(cycle) for cycle in cycles], rates.nothing)
    return sticking_estimate_of(terms, rate_error=rate_error, probability=probability)


def sticking_estimate_of(
    terms: MergeLikelihood, *, rate_error: float, probability: float
) -> StickingEstimate:
    """Sticking speed from the likelihood of the merges.

    Parameters
    ----------
    terms : MergeLikelihood
        Sum over all cycles.
    rate_error : float
        Standard deviation of the logarithm of a common error of all rates.
    probability : float, 0 to 1
        Of the interval, and of the upper limit without a merge.
    """
    grid, merges = terms.speeds, terms.merges
    if not terms.exposed:
        return _nothing(StickingStatus.STUCK_FROM_THE_START, float(grid[-1]), merges, probability)
    likelihood = merge_log_likelihood(terms, rate_error)
    return _posterior(grid, likelihood, merges, probability)


def merge_log_likelihood(terms: MergeLikelihood, rate_error: float) -> NDArray[np.float64]:
    """Log likelihood of each sticking speed of the grid, (n,), by the merges.

    Many cycles would tell the common error of the rates by how merges are spread over time, for
    which the theory of the rates is not right enough. So of several cycles each error stays as
    likely as before: up to a factor, it is their probability of each speed, averaged over them.

    Parameters
    ----------
    terms : MergeLikelihood
        Of cycles with bodies that could have merged.
    rate_error : float
        As of `sticking_estimate_of`.
    """
    several = terms.cycles > 1
    nodes = _CLOSE_NODES if several else _NORMAL_NODES
    weights = _CLOSE_WEIGHTS if several else _NORMAL_WEIGHTS
    factors = rate_error * nodes[:, np.newaxis]
    by_error = terms.merges * factors + terms.logs - np.exp(factors) * terms.expected
    if several:
        totals = logsumexp(by_error, axis=1, keepdims=True, b=np.gradient(terms.speeds))
        by_error = by_error - totals
    return np.asarray(log_sum(by_error, weights / weights.sum()))


def _posterior(
    grid: NDArray[np.float64], likelihood: NDArray[np.float64], merges: int, probability: float
) -> StickingEstimate:
    weights = np.exp(likelihood - likelihood.max()) * np.gradient(grid)
    total = np.cumsum(weights)
    posterior = _Posterior(grid=grid, likelihood=likelihood, total=total / total[-1])
    if merges == 0:
        status = StickingStatus.NO_MERGE
    elif posterior.is_open(probability):
        # All colliding bodies stuck: any higher speed fits as well.
        status = StickingStatus.NO_UPPER_LIMIT
    else:
        status = StickingStatus.MEASURED
    measured = status is StickingStatus.MEASURED
    low, high = posterior.interval(status, probability)
    narrow_low, narrow_high = posterior.interval(status, ONE_SIGMA)
    return StickingEstimate(
        status=status,
        sticking_speed=posterior.quantile(0.5) if measured else math.nan,
        lower=low,
        upper=high,
        lower_68=narrow_low,
        upper_68=narrow_high,
        merges=merges,
        probability=probability,
    )


class _Posterior(NamedTuple):
    """Sticking speeds, log likelihood of each, and probability of all up to it, (n,) each."""

    grid: NDArray[np.float64]
    likelihood: NDArray[np.float64]
    total: NDArray[np.float64]

    def quantile(self, probability: float) -> float:
        """The speed below which the sticking speed is with a probability."""
        return float(np.interp(probability, self.total, self.grid))

    def is_open(self, probability: float) -> bool:
        """Whether the highest speed fits as well."""
        return bool(self.likelihood[-1] > self.likelihood.max() - _drop(probability))

    def interval(self, status: StickingStatus, probability: float) -> tuple[float, float]:
        """From both sides where the speed is measured, else from one."""
        tail = 0.5 * (1.0 - probability)
        if status is StickingStatus.NO_MERGE:
            # Where any speed fits, the prior alone would give the limit.
            return 0.0, math.nan if self.is_open(probability) else self.quantile(probability)
        if status is StickingStatus.MEASURED:
            return self.quantile(tail), self.quantile(1.0 - tail)
        # The flat prior up to the highest speed would raise the quantile: the likelihood alone
        # gives the lower limit, half the square of a normal deviate below its maximum. The
        # deviate is that of an interval from both sides: whether there is an upper limit is
        # known from the same merges, which are the more frequent ones if there is none.
        likely = self.grid[self.likelihood >= self.likelihood.max() - _drop(probability)]
        return min(self.quantile(tail), float(likely[0])), float(self.grid[-1])


def _drop(probability: float) -> float:
    """What an interval from both sides leaves of the log likelihood at either end."""
    return 0.5 * NormalDist().inv_cdf(0.5 + 0.5 * probability) ** 2


def _nothing(
    status: StickingStatus, highest: float, merges: int, probability: float
) -> StickingEstimate:
    return StickingEstimate(
        status=status,
        sticking_speed=math.nan,
        lower=0.0,
        upper=highest,
        lower_68=0.0,
        upper_68=highest,
        merges=merges,
        probability=probability,
    )
