"""What all rebounds and collisions of some cycles say, kept so that more can be added."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import marginal, pair_table, rebound_table
from nanorocks_ros.inference.decay.decay_library import LOWEST_WALL
from nanorocks_ros.inference.likelihood_1d import SingleTerm
from nanorocks_ros.records import PairCollision, Rebound

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

# Single contacts say no more than some 0.02 of the beads, and some 0.003 of the walls: between
# these nodes a spline tells sums of their log likelihoods.
_BEADS = np.linspace(0.0, 1.0, 101)
_WALLS = np.linspace(LOWEST_WALL, 1.0, 221)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactTerms:
    """Log likelihoods of both restitutions by single contacts.

    Parameters
    ----------
    rebounds, collisions : int
        How many there were.
    walls, beads : ndarray (m, n)
        Tables of `rebound_table` and `pair_table`. What is not known, such as how wrong radii
        are, is the same in all contacts that are added up.
    """

    rebounds: int
    collisions: int
    walls: NDArray[np.float64]
    beads: NDArray[np.float64]

    @classmethod
    def of(cls, contacts: Iterable[Rebound | PairCollision]) -> ContactTerms:
        """Those of some contacts; of none they say nothing."""
        contacts = list(contacts)
        rebounds = [contact for contact in contacts if isinstance(contact, Rebound)]
        collisions = [contact for contact in contacts if isinstance(contact, PairCollision)]
        return cls(
            rebounds=len(rebounds),
            collisions=len(collisions),
            walls=rebound_table(rebounds, _WALLS),
            beads=pair_table(collisions, _BEADS),
        )

    def __add__(self, other: ContactTerms) -> ContactTerms:
        return ContactTerms(
            rebounds=self.rebounds + other.rebounds,
            collisions=self.collisions + other.collisions,
            walls=self.walls + other.walls,
            beads=self.beads + other.beads,
        )

    def of_walls(self, bias: float = 0.0) -> SingleTerm | None:
        """What rebounds say; None without any.

        Parameters
        ----------
        bias : float
            Standard deviation of what all of them together may be off by.
        """
        if not self.rebounds:
            return None
        term = SingleTerm(restitution=_WALLS, log_likelihood=marginal(self.walls))
        return term.off_by(bias)

    def of_beads(self, bias: float = 0.0) -> SingleTerm | None:
        """What collisions say, as `of_walls`."""
        if not self.collisions:
            return None
        term = SingleTerm(restitution=_BEADS, log_likelihood=marginal(self.beads))
        return term.off_by(bias)
