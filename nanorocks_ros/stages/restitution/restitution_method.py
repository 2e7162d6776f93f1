"""What a method that turns decays into restitutions gets, and what it gives.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from nanorocks_ros.records import Measured

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
    from nanorocks_ros.inference.contacts.rebound_reading import ReboundReading
    from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods, MeanRestitution
    from nanorocks_ros.records import CorRelation, Rebound
    from nanorocks_ros.stages.restitution.cycle_restitution import CycleRestitution

NO_AGE = Measured(0.0, 0.0)
"""Of a gas that was shaken at time 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """Speeds of one cycle.

    Parameters
    ----------
    time : ndarray (n,), [s]
        Since the shaking event or, where that was later, since the tray had come to rest.
    speed, error : ndarray (n,), [m/s]
    of_grains : bool
        Whether there are grains among the beads.
    age : Measured, [s]
        For which the gas had cooled before time 0.
    """

    time: NDArray[np.float64]
    speed: NDArray[np.float64]
    error: NDArray[np.float64]
    of_grains: bool = False
    age: Measured = NO_AGE


class Contacts(Protocol):
    """Contacts and flights of a cycle, as `CycleContacts` sums them."""

    @property
    def body_rebounds(self) -> int:
        """Rebounds of bodies of several beads among the contacts."""

    @property
    def flights(self) -> NDArray[np.float64]:
        """Table of the flights."""

    def terms(
        self,
        drag: float,
        reading_of: Callable[[Sequence[Rebound]], ReboundReading],
    ) -> ContactTerms:
        """Likelihoods of the contacts, parameters as of `CycleContacts.terms`."""


class RestitutionMethod(Protocol):
    """A method that turns decays into restitutions; it keeps the evidence of finished cycles."""

    relation: CorRelation
    evidence: CycleLikelihoods | None

    def estimate(
        self, decay: Decay | None, contacts: Contacts, *, final: bool
    ) -> CycleRestitution:
        """Restitution of a cycle; raises FitError where the speeds do not fall.

        Where beads stuck too soon for a decay there are contacts alone.
        """

    def mean_of(self, evidence: CycleLikelihoods) -> MeanRestitution:
        """Mean restitution of the cycles of some evidence, also of other recordings."""
