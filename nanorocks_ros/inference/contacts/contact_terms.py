"""Log-likelihood tables of all rebounds and collisions of some cycles, which add up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import marginal, pair_table, rebound_table
from nanorocks_ros.inference.contacts.wall_friction import friction_table, wall_friction
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.records import UNKNOWN_MEASURED, Measured, PairCollision, Rebound

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

LOWEST_REBOUND = 0.5
"""Lowest restitution of the walls for which rebounds are compared."""

# A single contact determines the bead restitution to 0.02 and the wall restitution to 0.003 at
# best: a spline through these nodes represents sums of log likelihoods.
_BEADS = np.linspace(0.0, 1.0, 101)
_WALLS = np.linspace(LOWEST_REBOUND, 1.0, 501)
# Where floor and lid rub, a flight loses speed between contact and the middle of the flight. One
# of its hits changes the horizontal speed by about the friction, relative to that speed; more
# than one bends the flight enough to end it. Before and after a rebound together: none to 1.4
# hits, equally likely, so that walls read too low by this times the friction, and this scatter.
_UNSEEN_HITS, _HITS_SPREAD = 0.7, 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactTerms:
    """Log likelihoods of both restitutions from single contacts.

    Parameters
    ----------
    rebounds, collisions : int
        Their numbers.
    walls, beads : ndarray (m, n)
        Tables of `rebound_table` and `pair_table`. Nuisances, such as the error of the radii, are
        common to all contacts that are added.
    friction : ndarray (m, n)
        Table of `friction_table`.
    """

    rebounds: int
    collisions: int
    walls: NDArray[np.float64]
    beads: NDArray[np.float64]
    friction: NDArray[np.float64]

    @classmethod
    def of(cls, contacts: Iterable[Rebound | PairCollision]) -> ContactTerms:
        """Tables of some contacts; 0 everywhere without contacts."""
        contacts = list(contacts)
        rebounds = [contact for contact in contacts if isinstance(contact, Rebound)]
        collisions = [contact for contact in contacts if isinstance(contact, PairCollision)]
        return cls(
            rebounds=len(rebounds),
            collisions=len(collisions),
            walls=rebound_table(rebounds, _WALLS),
            beads=pair_table(collisions, _BEADS),
            friction=friction_table(rebounds),
        )

    def __add__(self, other: ContactTerms) -> ContactTerms:
        return ContactTerms(
            rebounds=self.rebounds + other.rebounds,
            collisions=self.collisions + other.collisions,
            walls=self.walls + other.walls,
            beads=self.beads + other.beads,
            friction=self.friction + other.friction,
        )

    @property
    def wall_friction(self) -> Measured:
        """Coefficient of friction of the side walls, from rebounds; unknown without any."""
        return wall_friction(self.friction) if self.rebounds else UNKNOWN_MEASURED

    def rubbed_wall_likelihood(self, bias: float = 0.0) -> Likelihood1D | None:
        """As `wall_likelihood`, where floor and lid may slow the flights by their friction.

        Their friction is taken to be that of the side walls.
        """
        likelihood = self.wall_likelihood(bias)
        if likelihood is None:
            return None
        friction = self.wall_friction
        most_likely = max(friction.value, 0.0)
        spread = math.hypot(_HITS_SPREAD * most_likely, _UNSEEN_HITS * friction.error)
        return likelihood.shifted(_UNSEEN_HITS * most_likely).convolved(spread)

    def wall_likelihood(self, bias: float = 0.0) -> Likelihood1D | None:
        """Log likelihood of the wall restitution from rebounds; None without rebounds.

        Parameters
        ----------
        bias : float
            Standard deviation of a systematic error common to all of them.
        """
        if not self.rebounds:
            return None
        term = Likelihood1D(restitution=_WALLS, log_likelihood=marginal(self.walls))
        return term.convolved(bias)

    def bead_likelihood(self, bias: float = 0.0) -> Likelihood1D | None:
        """Log likelihood of the bead restitution from collisions, as `wall_likelihood`."""
        if not self.collisions:
            return None
        term = Likelihood1D(restitution=_BEADS, log_likelihood=marginal(self.beads))
        return term.convolved(bias)
