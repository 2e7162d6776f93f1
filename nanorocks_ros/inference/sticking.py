"""The speed below which beads stick, from when bodies merged: a Poisson likelihood.

Derived in docs/clusters.md, where its bias is measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import trapezoid
from scipy.special import logsumexp

from nanorocks_ros.errors import FitError
from nanorocks_ros.records import StickingStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.physics.sticking import SlowContacts
    from nanorocks_ros.records import Merge

_NS = 1e9
# Sticking speeds that are tried; they lie closer near 0.
_NODES = 600
# Log of a factor of all rates, in standard deviations: nodes and weights of its normal law.
_NORMAL_NODES, _NORMAL_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingCycle:
    """Merges of the bodies of a cycle, and how fast the beads were.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Rising; merges are looked for from the first to the last.
    speeds : ndarray (n,), [m/s]
        Mean projected speed of the beads.
    bodies : ndarray (n,)
        Free bodies.
    merges : ndarray (m,), [s]
        Times at which bodies merged.
    """

    times: NDArray[np.float64]
    speeds: NDArray[np.float64]
    bodies: NDArray[np.float64]
    merges: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingEstimate:
    """The sticking speed of some beads.

    Parameters
    ----------
    status : StickingStatus
    sticking_speed : float, [m/s]
        Median of what is probable; NaN unless measured.
    lower, upper : float, [m/s]
        Interval; from 0 to an upper limit without a merge, from a lower limit to the highest
        speed considered where all that met stuck.
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


def sticking_cycle(
    beads: int,
    merges: Sequence[Merge],
    stamps_ns: NDArray[np.int64],
    speeds: NDArray[np.float64],
    start_ns: int,
) -> StickingCycle:
    """What a `BodyCounter` found in a cycle, with speeds of the beads.

    Parameters
    ----------
    beads : int
        In the tray.
    merges : sequence of Merge
    stamps_ns : ndarray of int64, (n,), [ns]
        Of the speeds, rising. Nothing is asked of later times.
    speeds : ndarray (n,), [m/s]
    start_ns : int, [ns]
        The shaking event: until the first speed they are taken to be that.
    """
    end = (int(stamps_ns[-1]) - start_ns) / _NS
    found = sorted((one.stamp_ns - start_ns) / _NS for one in merges if one.joins)
    inside = np.array([max(one, 0.0) for one in found if one <= end])
    known = np.concatenate([[0.0], (stamps_ns - start_ns) / _NS])
    # Bodies are constant between merges: both values of each are nodes of the integral.
    times = np.sort(np.concatenate([known, inside, np.nextafter(inside, np.inf)]))
    fallen = np.searchsorted(inside, times, side='left')
    return StickingCycle(
        times=times,
        speeds=np.interp(times, known[1:], speeds),
        bodies=beads - fallen.astype(np.float64),
        merges=inside,
    )


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
    """The sticking speed that merges of bodies prefer; any up to the highest is as likely before.

    Parameters
    ----------
    cycles : sequence of StickingCycle
        One or many; each independent of the others.
    contacts : SlowContacts
        Of the tray.
    beads : int
        In the tray.
    measure : 'normal' or 'total'
        Which relative speed decides whether beads stick.
    highest : float, [m/s]
    least_share : float, 0 to 1
        Of the beads; with fewer bodies, large ones, the theory of single beads says too little.
    rate_error : float
        Standard deviation of the logarithm of all rates, by which the theory may be wrong.
    probability : float, 0 to 1
        Of the interval; one-sided limits have it, too.

    Raises
    ------
    ConfigurationError
        For an unknown measure.
    FitError
        For speeds or times that cannot be used.
    """
    grid = highest * (np.arange(1, _NODES + 1) / _NODES) ** 2
    used = [_first_part(_checked(one), least_share * beads) for one in cycles]
    merges = sum(one.merges.size for one in used)
    exposed = [one for one in used if one.times.size > 1 and one.bodies[0] > 1.0]
    if not exposed:
        return _nothing(StickingStatus.STUCK_FROM_THE_START, highest, merges, probability)
    terms = [_terms(one, contacts, beads, grid, measure) for one in exposed]
    logs, expected = (np.sum(part, axis=0) for part in zip(*terms, strict=True))
    factors = rate_error * _NORMAL_NODES
    likelihood = logsumexp(
        [merges * one + logs - np.exp(one) * expected for one in factors],
        b=_NORMAL_WEIGHTS[:, np.newaxis] / _NORMAL_WEIGHTS.sum(),
        axis=0,
    )
    return _posterior(grid, likelihood, merges, probability)


def _posterior(
    grid: NDArray[np.float64], likelihood: NDArray[np.float64], merges: int, probability: float
) -> StickingEstimate:
    weights = np.exp(likelihood - likelihood.max()) * np.gradient(grid)
    total = np.cumsum(weights)
    total /= total[-1]
    tail = 0.5 * (1.0 - probability)
    quantiles = (tail, 0.5, 1.0 - tail, probability, 1.0 - probability)
    low, median, high, limit, least = (float(one) for one in np.interp(quantiles, total, grid))
    if merges == 0:
        status, low, median, high = StickingStatus.NO_MERGE, 0.0, math.nan, limit
    elif likelihood[-1] > likelihood.max() - _UNLIMITED:
        # All that met stuck: any higher speed explains it as well.
        status, low, median = StickingStatus.NO_UPPER_LIMIT, least, math.nan
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


# A log likelihood at the highest speed within this of the largest limits nothing.
_UNLIMITED = 2.0


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


def _terms(
    one: StickingCycle,
    contacts: SlowContacts,
    beads: int,
    grid: NDArray[np.float64],
    measure: str,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum of the logarithms of the rates of the merges, and merges expected, each (n,)."""
    # Bodies meet as beads do: pairs of them, at the speed of the beads.
    scale = 0.5 * one.bodies**2 / beads * one.speeds * (one.bodies > 1.0)
    ratio = grid[:, np.newaxis] / one.speeds
    expected = trapezoid(scale * contacts.slower_between(ratio, measure), one.times, axis=1)
    speeds = np.interp(one.merges, one.times, one.speeds)
    slower = contacts.slower_between(grid[:, np.newaxis] / speeds, measure)
    logs = np.log(slower * speeds).sum(axis=1)
    return logs, np.asarray(expected)


def _first_part(one: StickingCycle, fewest: float) -> StickingCycle:
    """The cycle as long as there are enough bodies."""
    used = one.bodies >= max(fewest, 1.0 + 1e-9)
    end = int(np.argmin(used)) if not used.all() else used.size
    if end == 0:
        nothing = np.empty(0)
        return StickingCycle(times=nothing, speeds=nothing, bodies=nothing, merges=nothing)
    last = one.times[end - 1] if end < used.size else np.inf
    return StickingCycle(
        times=one.times[:end],
        speeds=one.speeds[:end],
        bodies=one.bodies[:end],
        merges=one.merges[one.merges <= last],
    )


def _checked(one: StickingCycle) -> StickingCycle:
    sizes = {one.times.size, one.speeds.size, one.bodies.size}
    if len(sizes) > 1 or not one.times.size:
        raise FitError(
            'sticking',
            f'{one.times.size} times, {one.speeds.size} speeds, {one.bodies.size} numbers',
            'give as many of each, one at least',
        )
    if not (np.diff(one.times) >= 0.0).all():
        raise FitError('sticking', 'times that do not rise', 'sort them')
    if not (np.isfinite(one.speeds).all() and (one.speeds > 0.0).all()):
        raise FitError(
            'sticking', 'a speed that is not positive', 'leave out what is not known, or at rest'
        )
    return one
