"""Likelihoods of the wall restitution from rebounds, and of the bead restitution from collisions.

Both are functions of one restitution alone, on a grid of its values, and are added to the log
likelihood of the decay. Constants that do not depend on the restitution are left out.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.contacts.contact_estimate import checked_grid
from nanorocks_ros.inference.contacts.momentum_balance import balance_log_likelihood
from nanorocks_ros.inference.contacts.projected_collisions import (
    RANGE,
    ProjectedCollisions,
    RadiusExcess,
    projected_log_likelihood,
)
from nanorocks_ros.numerics.log_sums import log_sum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from nanorocks_ros.records import PairCollision, Rebound

OUTLIERS = 0.05
"""Fraction of outliers among contacts: a wrong link, an undetected third bead."""

VERTICAL_RATIOS = (0.25, 0.4, 0.6, 0.9, 1.3)
"""Ratios of the mean squares of vertical and horizontal velocities; equally likely."""

_EXCESSES_OF_ALL = (-0.005, -0.0025, 0.0, 0.0025, 0.005, 0.0075, 0.0125)
_EXCESSES_OF_MEASURED = (-0.01, 0.01, 0.04)

EXCESSES = tuple(
    RadiusExcess(of_all, of_measured)
    for of_measured, of_all in product(_EXCESSES_OF_MEASURED, _EXCESSES_OF_ALL)
)
"""By how much radii exceed what distances tell; equally likely.

In drawn films and films by other code the radii of all beads were up to 1.2 % too large, those of
glass beads of 12 px besides up to 4 %, and of smaller ones more.
"""

MIDDLE_EXCESS = EXCESSES[len(EXCESSES) // 2]
"""The excess that is taken where only one is."""

ERROR_SCALES = (1.0, 1.4, 2.0, 2.8)
"""Factors by which the true errors of rebounds may exceed the stated ones. Not below 1: many slow
rebounds, whose stated errors are too large, would then give the few fast ones too much weight."""

PAIR_SCALES = (1.25, 1.75, 2.5)
"""The same factors for collisions, which tell them by their balance of momentum. Not below 1.25,
from the scatter of simulated cycles."""

PAIR_ERRORS = PAIR_SCALES[0]
"""The factor that is taken where only one is."""

MIDDLE_NUISANCE = len(EXCESSES) * (len(VERTICAL_RATIOS) // 2) + len(EXCESSES) // 2
"""Row of `pair_table` with that factor and the middle ones of the other nuisances."""

_AT_ONCE = 128
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


def marginal(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log likelihood, (n,), marginalised over the equally likely rows of a table.

    Parameters
    ----------
    table : ndarray (m, n)
        From `rebound_table` or `pair_table`, or a sum of such: the row is then common to all.
    """
    return np.asarray(log_sum(table) - math.log(len(table)))


def rebound_log_likelihood(
    rebounds: Sequence[Rebound], wall_restitution: ArrayLike, *, outliers: float = OUTLIERS
) -> NDArray[np.float64]:
    """Log likelihood of rebounds for each restitution of the side walls.

    See `rebound_table`.
    """
    return marginal(rebound_table(rebounds, wall_restitution, outliers=outliers))


def rebound_table(
    rebounds: Sequence[Rebound], wall_restitution: ArrayLike, *, outliers: float = OUTLIERS
) -> NDArray[np.float64]:
    """Log likelihood of rebounds for each restitution of the side walls and each scale of errors.

    The speeds before and after have errors of the same size, and the prior of the speed before is
    flat. The detection of a rebound does not depend on the speed after it.

    Parameters
    ----------
    rebounds : sequence of Rebound
    wall_restitution : array_like (n,), 0 to 1
    outliers : float, 0 to 1
        Fraction of outliers.

    Returns
    -------
    ndarray (m, n)
        Log likelihood up to a constant; 0 without rebounds. Tables of more rebounds add up.
    """
    grid = checked_grid('wall_restitution', wall_restitution)
    _check_share(outliers)
    if not rebounds:
        return np.zeros((len(ERROR_SCALES), grid.size))
    columns = np.array(
        [
            (rebound.incoming.value, rebound.outgoing.value, rebound.incoming.error,
             rebound.outgoing.error, rebound.wall_velocity.error)
            for rebound in rebounds
        ]
    )  # fmt: skip
    incoming, outgoing, before, after, wall = columns.T[:, :, None]
    # The speed of the wall enters both speeds, with opposite signs.
    variance = (grid * before) ** 2 + after**2 + ((1.0 + grid) * wall) ** 2
    square = (outgoing - grid * incoming) ** 2 / variance
    outlier_density = outliers / (RANGE * incoming)
    by_scale = []
    for scale in ERROR_SCALES:
        density = np.exp(-0.5 * square / scale**2) / (_SQRT_2_PI * scale * np.sqrt(variance))
        by_scale.append(np.log((1.0 - outliers) * density + outlier_density).sum(axis=0))
    return np.array(by_scale)


def pair_log_likelihood(
    collisions: Sequence[PairCollision],
    restitution: ArrayLike,
    *,
    vertical_ratios: Sequence[float] = VERTICAL_RATIOS,
    excesses: Sequence[RadiusExcess] = EXCESSES,
    sticking_speed: float = 0.0,
    outliers: float = OUTLIERS,
) -> NDArray[np.float64]:
    """Log likelihood of collisions for each restitution of the beads.

    See `pair_table`.
    """
    return marginal(
        pair_table(
            collisions,
            restitution,
            vertical_ratios=vertical_ratios,
            excesses=excesses,
            sticking_speed=sticking_speed,
            outliers=outliers,
        )
    )


def pair_table(
    collisions: Sequence[PairCollision],
    restitution: ArrayLike,
    *,
    vertical_ratios: Sequence[float] = VERTICAL_RATIOS,
    excesses: Sequence[RadiusExcess] = EXCESSES,
    sticking_speed: float = 0.0,
    outliers: float = OUTLIERS,
) -> NDArray[np.float64]:
    """Log likelihood of collisions for each restitution and each value of the nuisances.

    These are, in the order of the rows, factors of the errors, vertical ratios and excesses.

    Parameters
    ----------
    collisions : sequence of PairCollision
    restitution : array_like (n,), 0 to 1
    vertical_ratios : sequence of float, > 0
        Ratio of the mean squares of a vertical and a horizontal velocity component, common to
        all collisions; the values are equally likely.
    excesses : sequence of RadiusExcess
        Of the radii of all collisions; the values are equally likely.
    sticking_speed : float, [m/s]
        Beads with a smaller approach speed along the line of centres merge, so that their
        collisions are missing.
    outliers : float, 0 to 1
        Fraction of outliers.

    Returns
    -------
    ndarray (m, n)
        Log likelihood up to a constant; 0 without collisions. Tables of more collisions add up.
    """
    grid = checked_grid('restitution', restitution)
    _check_share(outliers)
    if not collisions:
        return np.zeros((len(PAIR_SCALES) * len(vertical_ratios) * len(excesses), grid.size))
    stated = ProjectedCollisions.of(collisions)
    limits = sticking_speed, outliers
    ratios = np.array(vertical_ratios, dtype=np.float64)
    # Without radii that are measured bead by bead their excess has no effect.
    has_effect = bool(stated.measured.any())
    needed = [excess if has_effect else excess._replace(measured=0.0) for excess in excesses]
    different = list(dict.fromkeys(needed))
    rows = [different.index(excess) for excess in needed]
    balance = balance_log_likelihood(collisions, PAIR_SCALES, outliers)
    by_scale = []
    for scale, of_balance in zip(PAIR_SCALES, balance, strict=True):
        seen = stated.with_errors(scale)
        # In batches, so that memory does not grow with the number of collisions.
        parts = [
            ProjectedCollisions(*(column[k : k + _AT_ONCE] for column in seen))
            for k in range(0, len(collisions), _AT_ONCE)
        ]
        logs = [projected_log_likelihood(part, grid, ratios, different, limits) for part in parts]
        by_scale.append(np.sum(logs, axis=0)[:, rows] + of_balance)
    return np.asarray(np.reshape(by_scale, (-1, grid.size)))


def _check_share(outliers: float) -> None:
    if not 0.0 < outliers < 1.0:
        raise FitError('outliers', f'a fraction of {outliers!r}', 'give one between 0 and 1')
