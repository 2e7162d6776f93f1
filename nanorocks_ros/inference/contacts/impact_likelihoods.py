"""Likelihood of contacts at their impact speeds, for a law of the restitution.

About a contact the restitution follows the tangent of the law, so that its likelihood stays in
closed form.

Tested by ``test/inference/contacts/test_restitution_exponent.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import OUTLIERS
from nanorocks_ros.inference.contacts.impact_tables import (
    INCOMING,
    INCOMING_ERROR,
    LOSS_COLUMNS,
    NODES,
    OUTGOING,
    OUTGOING_ERROR,
    WALL_ERROR,
)
from nanorocks_ros.inference.contacts.projected_collisions import RANGE
from nanorocks_ros.numerics.compiled import compiled, inlined

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Exponents of simulated cycles by collisions scatter so much more than each collision by itself
# says: radii and vertical speeds are common to them.
_COLLISION_SCATTER = 1.3
# 1 + restitution of two beads, for the reference speed.
_MEAN_GAIN = 1.85
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


class Impacts(Protocol):
    """Contacts of one kind.

    `rows`: a contact each; `gain`: as of `RestitutionLaw`.
    """

    rows: NDArray[np.float64]
    gain: float

    @property
    def speeds(self) -> NDArray[np.float64]:
        """Impact speeds, (n,), [m/s]."""

    @property
    def reference(self) -> float:
        """Geometric mean of the impact speeds, [m/s]."""

    def part(self, places: NDArray[np.int64]) -> Impacts:
        """Some of them."""

    def logs(
        self,
        kept: NDArray[np.float64],
        restitutions: NDArray[np.float64],
        exponents: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Log likelihood, (r, p), of restitutions at the reference speed and of exponents."""


class ReboundImpacts:
    """Rebounds from walls.

    Parameters
    ----------
    impacts : ndarray (n, REBOUND_COLUMNS)
        From `rebound_impacts`.
    scale : float
        Of their errors.
    """

    gain = 0.0

    def __init__(self, impacts: NDArray[np.float64], scale: float) -> None:
        self.rows = impacts.copy()
        self.rows[:, [INCOMING_ERROR, OUTGOING_ERROR, WALL_ERROR]] *= scale

    @property
    def speeds(self) -> NDArray[np.float64]:
        """As of `Impacts`."""
        return self.rows[:, INCOMING]

    @property
    def reference(self) -> float:
        """As of `Impacts`."""
        return _geometric_mean(self.speeds)

    def part(self, places: NDArray[np.int64]) -> ReboundImpacts:
        """As of `Impacts`."""
        return ReboundImpacts(self.rows[places], 1.0)

    def logs(
        self,
        kept: NDArray[np.float64],
        restitutions: NDArray[np.float64],
        exponents: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """As of `Impacts`."""
        return _rebound_logs(self.rows, kept, self.reference, restitutions, exponents)


class CollisionImpacts:
    """Collisions of two beads.

    Parameters
    ----------
    impacts : ndarray (n, COLLISION_COLUMNS)
        From `collision_impacts`.
    """

    gain = _MEAN_GAIN

    def __init__(self, impacts: NDArray[np.float32] | NDArray[np.float64]) -> None:
        self.rows = impacts.astype(np.float64)

    @property
    def speeds(self) -> NDArray[np.float64]:
        """As of `Impacts`."""
        return self.rows[:, LOSS_COLUMNS] / self.gain

    @property
    def reference(self) -> float:
        """As of `Impacts`."""
        return _geometric_mean(self.speeds)

    def part(self, places: NDArray[np.int64]) -> CollisionImpacts:
        """As of `Impacts`."""
        return CollisionImpacts(self.rows[places])

    def logs(
        self,
        kept: NDArray[np.float64],
        restitutions: NDArray[np.float64],
        exponents: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """As of `Impacts`."""
        logs = _collision_logs(self.rows, kept, self.reference, restitutions, exponents)
        return logs / _COLLISION_SCATTER**2


def _geometric_mean(speeds: NDArray[np.float64]) -> float:
    return math.exp(float(np.log(speeds).mean()))


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
