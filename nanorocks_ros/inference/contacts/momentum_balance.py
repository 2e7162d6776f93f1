"""Errors of collisions over the stated ones, from the momentum that both beads seem to lose.

Collisions keep the momentum of their two beads, whatever the restitution and the tilt of the line
of centres: what is missing of it is error.

Tested by ``test/inference/contacts/test_momentum_balance.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import PairCollision

MOST_MISSING = 4.0
"""Most momentum that a collision misses, in stated errors; of more a third body has a part."""


def balance_log_likelihood(
    collisions: Sequence[PairCollision], scales: Sequence[float], outliers: float
) -> NDArray[np.float64]:
    """Log likelihood of factors by which the true errors exceed the stated ones, (scales,).

    Parameters
    ----------
    collisions : sequence of PairCollision
        As they are found: none misses more than `MOST_MISSING`.
    scales : sequence of float, > 0
    outliers : float, 0 to 1
        Fraction of collisions that miss anything up to there.
    """
    if not collisions:
        return np.zeros(len(scales))
    missing = np.array([_missing(collision) for collision in collisions])
    squares, of_masses = missing[:, :2] ** 2, missing[:, 2]
    variances = np.array(scales)[:, np.newaxis] ** 2
    along, across = variances + of_masses**2, variances
    area = np.sqrt(along * across)
    density = np.exp(-0.5 * (squares[:, 0] / along + squares[:, 1] / across))
    density /= 2.0 * math.pi * area * -np.expm1(-0.5 * MOST_MISSING**2 / area)
    anything = outliers / (math.pi * MOST_MISSING**2)
    total: NDArray[np.float64] = np.log((1.0 - outliers) * density + anything).sum(axis=1)
    return total


def missing_momentum(collision: PairCollision) -> NDArray[np.float64]:
    """Momentum that a collision seems to gain, in stated errors of a component, (2,)."""
    missing: NDArray[np.float64] = collision.masses @ (collision.after - collision.before)
    return missing / _stated_error(collision)


def _stated_error(collision: PairCollision) -> float:
    """Of a component of the momentum that is missing, [kg m/s]."""
    errors = np.hypot(collision.before_errors, collision.after_errors)
    return math.hypot(*(collision.masses * errors))


def _missing(collision: PairCollision) -> tuple[float, float, float]:
    """Momentum missing along the line of centres and across, and by which masses err along it.

    In units of the stated error of a component.
    """
    normal = collision.separation / math.hypot(*collision.separation)
    along, across = missing_momentum(collision) @ np.column_stack([normal, normal[::-1] * (-1, 1)])
    # A mass grows with the third power of the radius.
    shares = 3.0 * collision.radius_errors / collision.radii
    gained = collision.masses * ((collision.after - collision.before) @ normal)
    of_masses = math.hypot(*(shares * gained)) / _stated_error(collision)
    return float(along), float(across), of_masses
