"""Tests for trends over many cycles, and for periods with larger clusters than usual."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Ratio of standard deviation to median absolute deviation of a normal distribution.
_MAD = 1.4826
_ONE_SIGMA = 0.6827
# Smallest number of points for a slope.
_FEWEST = 5
# Smallest mean excess of a period, in standard deviations of a cycle: next to a run of small
# clusters the usual ones would count as large.
_LEAST_EXCESS = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """A robust straight line through values by cycle.

    Parameters
    ----------
    slope, slope_error : float
        Change of the value per cycle, and one standard error; NaN for too few values, and for
        the error if values do not scatter. Cycles are assumed independent: with correlated
        neighbours the error is too small.
    middle : float
        Intercept: median of the values minus slope times cycle.
    samples : int
    """

    slope: float
    slope_error: float
    middle: float
    samples: int

    def at(self, cycles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the line."""
        return np.asarray(self.middle + self.slope * cycles)


def robust_trend(cycles: NDArray[np.float64], values: NDArray[np.float64]) -> Trend:
    """Theil-Sen line: the median of the slopes between all pairs, robust against outliers.

    Parameters
    ----------
    cycles, values : ndarray (n,)
        NaN for an unknown value.

    References
    ----------
    Theil 1950; Sen 1968, J. Am. Stat. Assoc. 63, 1379, whose interval, at 68 %, is the error.
    """
    x, y = np.asarray(cycles, dtype=np.float64), np.asarray(values, dtype=np.float64)
    is_finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[is_finite], y[is_finite]
    if x.size < _FEWEST or np.ptp(x) == 0.0:
        middle = float(np.median(y)) if y.size else math.nan
        return Trend(slope=math.nan, slope_error=math.nan, middle=middle, samples=int(x.size))
    # Half a second to import, and only a series of many cycles needs it.
    from scipy import stats

    slope, _, low, high = stats.theilslopes(y, x, alpha=_ONE_SIGMA)
    return Trend(
        slope=float(slope),
        slope_error=0.5 * float(high - low) or _least_squares_error(x, y - slope * x),
        middle=float(np.median(y - slope * x)),
        samples=int(x.size),
    )


def _least_squares_error(x: NDArray[np.float64], left: NDArray[np.float64]) -> float:
    """Error of a slope if most values are equal, such as counts, and the median gives 0."""
    scatter = float(np.std(left, ddof=2)) / math.sqrt(float(np.sum((x - x.mean()) ** 2)))
    return scatter or math.nan


class QuietPeriod(NamedTuple):
    """Consecutive cycles with larger clusters than usual, in all trays together.

    Parameters
    ----------
    first, last : int
        Indices in the series, inclusive.
    excess : float
        Mean of its cycles, in standard deviations of a cycle.
    chance : float
        Fraction of the series in random order with a period as significant as this.
    """

    first: int
    last: int
    excess: float
    chance: float


def quiet_periods(
    sizes: NDArray[np.float64],
    false_alarms: float = 0.01,
    shortest: int = 3,
    orders: int = 999,
    seed: int = 1,
) -> tuple[QuietPeriod, ...]:
    """Periods in which clusters grew larger; the paper finds three by eye.

    Residuals of the sizes about the trend of each tray, in units of their scatter, are averaged
    over the trays. The most significant period is the run of cycles with the largest sum divided
    by the square root of their number, if its mean is one standard deviation or more. It counts
    if the same cycles in random order have such a run in at most `false_alarms` of the draws.
    Then the rest of the series is searched in the same way.

    Parameters
    ----------
    sizes : ndarray (n_trays, n_cycles)
        NaN where unknown.
    false_alarms : float, (0, 0.5]
        Fraction of series without a period in which one is reported, for independent cycles.
    shortest : int, >= 1
        Smallest number of cycles of a period.
    orders : int
        Number of random orders, 1 / `false_alarms` or more.
    seed : int

    Returns
    -------
    tuple of QuietPeriod
        In order of time.

    Raises
    ------
    ConfigurationError
        For numbers outside their ranges.
    """
    if not (0.0 < false_alarms <= 0.5) or orders < 1.0 / false_alarms - 1.0 - 1e-9:
        raise ConfigurationError(
            'false alarms',
            f'{false_alarms!r} with {orders} random orders',
            f'give {1.0 / (orders + 1):g} to 0.5',
        )
    if shortest < 1:
        raise ConfigurationError('shortest', f'{shortest}', 'give 1 or more cycles')
    series = combined_series(sizes)
    places = np.flatnonzero(np.isfinite(series))
    pieces = [places] if places.size else []
    rng = np.random.default_rng(seed)
    periods: list[QuietPeriod] = []
    while pieces:
        values = [series[piece] for piece in pieces]
        best = _clearest(values, shortest)
        if best is None:
            break
        clear, which, first, last = best
        every = np.concatenate(values)
        chance = _chance(clear, every, [value.size for value in values], shortest, (orders, rng))
        if chance > false_alarms:
            break
        piece = pieces.pop(which)
        own = piece[first : last + 1]
        periods.append(QuietPeriod(int(own[0]), int(own[-1]), float(np.mean(series[own])), chance))
        pieces += [part for part in (piece[:first], piece[last + 1 :]) if part.size]
    return tuple(sorted(periods))


def combined_series(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scaled mean over the trays of the residuals about their trends, (n_cycles,)."""
    rows = np.atleast_2d(np.asarray(sizes, dtype=np.float64))
    cycles = np.arange(rows.shape[1], dtype=np.float64)
    scores = np.full(rows.shape, np.nan)
    for k, row in enumerate(rows):
        trend = robust_trend(cycles, row)
        if math.isfinite(trend.slope):
            scores[k] = _scaled(row - trend.at(cycles))
    counts = np.isfinite(scores).sum(axis=0)
    total = np.nansum(scores, axis=0)
    # The mean of fewer trays scatters more: scaled to the same scatter.
    mean = np.where(counts > 0, total / np.sqrt(np.maximum(counts, 1)), np.nan)
    return _scaled(mean)


def _scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    finite_values = values[np.isfinite(values)]
    if finite_values.size == 0:
        return values
    middle = float(np.median(finite_values))
    scatter = _MAD * float(np.median(np.abs(finite_values - middle)))
    return np.asarray(
        (values - middle) / scatter if scatter > 0.0 else np.full_like(values, np.nan)
    )


def _clearest(
    values: Sequence[NDArray[np.float64]], shortest: int
) -> tuple[float, int, int, int] | None:
    """Significance, piece, first and last index of the most significant run."""
    best: tuple[float, int, int, int] | None = None
    for which, value in enumerate(values):
        sums = np.concatenate(([0.0], np.cumsum(value)))
        for length in range(shortest, _longest(value.size) + 1):
            runs = (sums[length:] - sums[:-length]) / math.sqrt(length)
            first = int(np.argmax(runs))
            if runs[first] < _LEAST_EXCESS * math.sqrt(length):
                continue
            if best is None or runs[first] > best[0]:
                best = float(runs[first]), which, first, first + length - 1
    return best


def _chance(
    clear: float,
    values: NDArray[np.float64],
    lengths: Sequence[int],
    shortest: int,
    draws: tuple[int, np.random.Generator],
) -> float:
    """Fraction of random orders, the actual one included, with a run as significant."""
    orders, rng = draws
    shuffled = rng.permuted(np.tile(values, (orders, 1)), axis=1)
    best = np.full(orders, -np.inf)
    start = 0
    for size in lengths:
        piece = shuffled[:, start : start + size]
        start += size
        sums = np.concatenate((np.zeros((orders, 1)), np.cumsum(piece, axis=1)), axis=1)
        for length in range(shortest, _longest(size) + 1):
            runs = (sums[:, length:] - sums[:, :-length]).max(axis=1) / math.sqrt(length)
            best = np.where(
                runs >= _LEAST_EXCESS * math.sqrt(length), np.maximum(best, runs), best
            )
    return float(1 + np.count_nonzero(best >= clear)) / (orders + 1)


def _longest(cycles: int) -> int:
    """Longest period: more than half of all cycles would be the usual state."""
    return cycles // 2
