"""Mixtures of normal distributions of one variable, with strays, and how many there are."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_ITERATIONS, _TOLERANCE = 200, 1e-7
# Share of the strays at the start, which are spread evenly over the range of the values.
_STRAYS = 0.05
# Smallest range of strays, in smallest deviations: those of equal values are no strays.
_LEAST_RANGE = 50.0


class Mixture(NamedTuple):
    """Normal distributions that values were drawn from.

    Parameters
    ----------
    means, deviations, shares : ndarrays (k,)
        In ascending order of the means; the rest of the shares are strays.
    bic : float
        Bayesian information criterion; the smaller, the better.
    """

    means: NDArray[np.float64]
    deviations: NDArray[np.float64]
    shares: NDArray[np.float64]
    bic: float


def fit_mixture(
    values: NDArray[np.float64], count: int, least_deviation: float, independent: float
) -> Mixture:
    """Fit so many normal distributions, and evenly spread strays, by expectation maximisation.

    Parameters
    ----------
    values : ndarray (n,), n >= `count`
    count : int
    least_deviation : float, > 0
        The smallest deviation of a distribution: the error of a value.
    independent : float
        So many of the values are independent; the criterion counts the likelihood of these.

    Raises
    ------
    ValueError
        For fewer values than distributions.

    References
    ----------
    Dempster, Laird & Rubin, J. R. Stat. Soc. B 39, 1 (1977); Schwarz, Ann. Stat. 6, 461 (1978).
    """
    if len(values) < count:
        raise ValueError(f'{len(values)} values for {count} distributions')
    means = _split_means(np.sort(values), count)
    off = np.abs(values[:, None] - means)
    nearest = np.argmin(off, axis=1)
    parts = np.maximum(np.bincount(nearest, minlength=count), 1)
    squares = np.bincount(nearest, off.min(axis=1) ** 2, minlength=count)
    deviations = np.maximum(np.sqrt(squares / parts), least_deviation)
    shares = (1.0 - _STRAYS) * parts / parts.sum()
    extent = max(float(np.ptp(values)), _LEAST_RANGE * least_deviation)
    before = -math.inf
    for _ in range(_ITERATIONS):
        density = shares * np.exp(-0.5 * ((values[:, None] - means) / deviations) ** 2)
        density /= math.sqrt(2.0 * math.pi) * deviations
        total = density.sum(axis=1) + (1.0 - shares.sum()) / extent
        mean_log = float(np.log(total).mean())
        if mean_log - before < _TOLERANCE:
            break
        before = mean_log
        members = density / total[:, None]
        weights = np.maximum(members.sum(axis=0), 1e-9)
        means = members.T @ values / weights
        squares = (members * (values[:, None] - means) ** 2).sum(axis=0) / weights
        deviations = np.maximum(np.sqrt(squares), least_deviation)
        # A few strays remain possible.
        shares = np.minimum(weights / len(values), 1.0 - 1e-3 / count)
        shares *= min(1.0, (1.0 - 1e-3) / shares.sum())
    order = np.argsort(means)
    # Means, deviations and shares.
    bic = 3 * count * math.log(max(independent, 2.0)) - 2.0 * independent * mean_log
    return Mixture(means[order], deviations[order], shares[order], bic)


def likeliest_mixture(
    values: NDArray[np.float64], most: int, least_deviation: float, independent: float
) -> Mixture:
    """The mixture of 1 to `most` distributions with the least BIC; see `fit_mixture`."""
    fits = [
        fit_mixture(values, count, least_deviation, independent)
        for count in range(1, min(most, len(values)) + 1)
    ]
    return min(fits, key=lambda mixture: mixture.bic)


def _split_means(ordered: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Means of the parts that ordered values fall into with least squares, exactly.

    The best split into k parts of the first n values follows from that into k - 1 parts.
    """
    # Many values are well enough described by as many of their quantiles.
    if len(ordered) > 200:
        ordered = np.quantile(ordered, (np.arange(200) + 0.5) / 200)
    n = len(ordered)
    sums = np.concatenate([[0.0], np.cumsum(ordered)])
    squares = np.concatenate([[0.0], np.cumsum(ordered**2)])
    first, last = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing='ij')
    lengths = np.maximum(last - first, 1)
    within = squares[last] - squares[first] - (sums[last] - sums[first]) ** 2 / lengths
    costs = np.where(last > first, within, math.inf)
    best, starts = costs[0], []
    for _ in range(count - 1):
        extended = best[:, None] + costs
        starts.append(np.argmin(extended, axis=0))
        best = extended.min(axis=0)
    ends = [n]
    for start in reversed(starts):
        ends.append(int(start[ends[-1]]))
    limits = [0, *reversed(ends)]
    return np.array([ordered[low:high].mean() for low, high in pairwise(limits)])
