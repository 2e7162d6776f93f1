"""Log-likelihood tables of all rebounds and collisions of some cycles, which add up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import marginal, pair_table, rebound_table
from nanorocks_ros.inference.decay.decay_library import LOWEST_WALL
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.records import PairCollision, Rebound

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

# A single contact determines the bead restitution to 0.02 and the wall restitution to 0.003 at
# best: a spline through these nodes represents sums of log likelihoods.
_BEADS = np.linspace(0.0, 1.0, 101)
_WALLS = np.linspace(LOWEST_WALL, 1.0, 221)


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
    """

    rebounds: int
    collisions: int
    walls: NDArray[np.float64]
    beads: NDArray[np.float64]

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
        )

    def __add__(self, other: ContactTerms) -> ContactTerms:
        return ContactTerms(
            rebounds=self.rebounds + other.rebounds,
            collisions=self.collisions + other.collisions,
            walls=self.walls + other.walls,
            beads=self.beads + other.beads,
        )

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
