"""Collisions of beads that stick below a speed: likelihood of restitution and sticking speed.

Slower collisions do not part, so that those that do are the faster ones: the likelihood of each is
that given an impact above the sticking speed. With the merges, which tell that speed, both are
known together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import marginal, pair_table
from nanorocks_ros.inference.contacts.contact_terms import BEADS
from nanorocks_ros.numerics.log_sums import log_sum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import PairCollision

_NODES = 80
_HIGHEST = 0.03
SPEEDS = _HIGHEST * (np.arange(_NODES + 1) / _NODES) ** 2
"""Sticking speeds at which collisions are compared, (n,), [m/s]: dense near 0, up to the end of
the prior of the sticking speed."""
# Probabilities of sticking speeds below this are left out.
_UNLIKELY = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True)
class BounceTables:
    """Log likelihood of collisions for each sticking speed; those of more collisions add up.

    Parameters
    ----------
    collisions : int
    logs : ndarray (n, m, k)
        Tables of `pair_table` at `SPEEDS` and the restitutions `BEADS`.
    """

    collisions: int
    logs: NDArray[np.float64]

    @classmethod
    def of(cls, collisions: Sequence[PairCollision]) -> BounceTables:
        """Tables of some collisions; 0 everywhere without any."""
        tables = [pair_table(collisions, BEADS, sticking_speed=speed) for speed in SPEEDS.tolist()]
        return cls(collisions=len(collisions), logs=np.array(tables))

    def __add__(self, other: BounceTables) -> BounceTables:
        return BounceTables(
            collisions=self.collisions + other.collisions, logs=self.logs + other.logs
        )

    def bead_table(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Table of `pair_table`, (m, k), with the sticking speed integrated over.

        Parameters
        ----------
        weights : ndarray (n,)
            Probability of each of `SPEEDS` by the merges.
        """
        likely = weights > _UNLIKELY
        rows = self.logs[likely]
        joint = log_sum(rows.reshape(len(rows), -1), weights[likely])
        return np.asarray(joint).reshape(self.logs.shape[1:])

    def speed_log_likelihood(self) -> NDArray[np.float64]:
        """Log likelihood of each of `SPEEDS`, (n,), for a flat prior of the restitution."""
        by_speed = [marginal(table) for table in self.logs]
        ends = np.ones(BEADS.size)
        ends[[0, -1]] = 0.5
        return log_sum(np.array(by_speed).T, ends / ends.sum())


class RunningBounces:
    """Tables of the collisions of a cycle so far; those known before are not worked out anew."""

    def __init__(self) -> None:
        self._collisions: list[PairCollision] = []
        self._tables: BounceTables | None = None

    def of(self, collisions: Sequence[PairCollision]) -> BounceTables:
        """Tables of the collisions, of which most were there before.

        Parameters
        ----------
        collisions : sequence of PairCollision
        """
        known = len(self._collisions)
        is_longer = len(collisions) >= known and all(
            new is old for new, old in zip(collisions, self._collisions, strict=False)
        )
        if self._tables is None or not is_longer:
            self._tables, known = BounceTables.of(()), 0
        if len(collisions) > known:
            self._tables += BounceTables.of(collisions[known:])
        self._collisions = list(collisions)
        return self._tables


def node_weights(
    speeds: NDArray[np.float64], log_likelihood: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Probability of each of `SPEEDS`, (n,), for a flat prior of the sticking speed.

    Between two of them a sticking speed counts for both, by its distance.

    Parameters
    ----------
    speeds : ndarray (s,), [m/s]
        Rising.
    log_likelihood : ndarray (s,)
    """
    density = np.exp(log_likelihood - log_likelihood.max()) * np.gradient(speeds)
    places = np.interp(speeds, SPEEDS, np.arange(SPEEDS.size))
    below = np.minimum(places.astype(np.int64), SPEEDS.size - 2)
    weights = np.bincount(below, density * (1.0 + below - places), SPEEDS.size)
    weights += np.bincount(below + 1, density * (places - below), SPEEDS.size)
    return np.asarray(weights / weights.sum())
