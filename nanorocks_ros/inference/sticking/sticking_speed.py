"""Sticking speed from the times at which bodies merged: a Poisson likelihood.

Derived in docs/method/clusters.md; accuracy in docs/validation/sticking_accuracy.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import add
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.sticking.merge_likelihood import MergeLikelihood, MergeRates
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import StickingStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
    from nanorocks_ros.physics.sticking_rates import SlowContacts

# Log of a factor of all rates, in standard deviations: nodes and weights of its normal law.
_NORMAL_NODES, _NORMAL_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingEstimate:
    """The sticking speed of some beads.

    Parameters
    ----------
    status : StickingStatus
    sticking_speed : float, [m/s]
        Median of the posterior; NaN unless measured.
    lower, upper : float, [m/s]
        Interval. Without a merge it runs from 0 to an upper limit; if all colliding bodies stuck,
        from a lower limit to the highest speed of the grid.
    merges : int
    probability : float, 0 to 1
        Of the interval.
    """

    status: StickingStatus
    sticking_speed: float
    lower: float
    upper: float
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
    rate_error: float = 0.1,
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

    Parameters
    ----------
    terms : MergeLikelihood
        Of cycles with bodies that could have merged.
    rate_error : float
        As of `sticking_estimate_of`.
    """
    factors = rate_error * _NORMAL_NODES[:, np.newaxis]
    return np.asarray(
        log_sum(
            terms.merges * factors + terms.logs - np.exp(factors) * terms.expected,
            _NORMAL_WEIGHTS / _NORMAL_WEIGHTS.sum(),
        )
    )


def _posterior(
    grid: NDArray[np.float64], likelihood: NDArray[np.float64], merges: int, probability: float
) -> StickingEstimate:
    weights = np.exp(likelihood - likelihood.max()) * np.gradient(grid)
    total = np.cumsum(weights)
    total /= total[-1]
    tail = 0.5 * (1.0 - probability)
    quantiles = (tail, 0.5, 1.0 - tail, probability)
    low, median, high, limit = (float(value) for value in np.interp(quantiles, total, grid))
    # What an interval from both sides leaves at either end.
    drop = 0.5 * NormalDist().inv_cdf(1.0 - tail) ** 2
    if merges == 0:
        status, low, median, high = StickingStatus.NO_MERGE, 0.0, math.nan, limit
    elif likelihood[-1] > likelihood.max() - drop:
        # All colliding bodies stuck: any higher speed fits as well.
        # The flat prior up to the highest speed would raise the quantile: the likelihood alone
        # gives the lower limit, half the square of a normal deviate below its maximum. The
        # deviate is that of an interval from both sides: whether there is an upper limit is
        # known from the same merges, which are the more frequent ones if there is none.
        likely = grid[likelihood >= likelihood.max() - drop]
        low = min(low, float(likely[0]))
        status, median = StickingStatus.NO_UPPER_LIMIT, math.nan
        high = float(grid[-1])
    else:
        status = StickingStatus.MEASURED
    return StickingEstimate(
        status=status,
        sticking_speed=median,
        lower=low,
        upper=high,
        merges=merges,
        probability=probability,
    )


def _nothing(
    status: StickingStatus, highest: float, merges: int, probability: float
) -> StickingEstimate:
    return StickingEstimate(
        status=status,
        sticking_speed=math.nan,
        lower=0.0,
        upper=highest,
        merges=merges,
        probability=probability,
    )
