"""Rebounds, collisions and flights of the current cooling cycle, for the restitution fit.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.flights.flight_losses import flight_table
from nanorocks_ros.records import FreeFlight, PairCollision, Rebound
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.records import Contact, ContactOrFlight
    from nanorocks_ros.settings import CoolingSettings

# Between two cooling windows contacts come in that no fit uses.
_MAX_WAITING = 5000
# Error of the time of a merge, [ns]: the contact that made the body may be dated before it.
_MERGE_ERROR_NS = 100_000_000
# Change of the drag from which on the speeds of all contacts are corrected again, [1/s]; a smaller
# one shifts their likelihood.
_DRAG_STEP = 0.003


class CycleContacts:
    """Sums the contacts from the end of the shaking to the end of the cooling window.

    A contact is known 1.5 s after it happened. Contacts of the last 2 s before the last speed are
    not used: the result does not depend on the order in which speeds and contacts come in.

    Parameters
    ----------
    settings : CoolingSettings
        Which kinds of contacts are used.
    """

    def __init__(self, settings: CoolingSettings) -> None:
        used = {
            Rebound: settings.rebounds,
            PairCollision: settings.collisions,
            FreeFlight: settings.rebounds or settings.collisions,
        }
        self._used = tuple(kind for kind, enabled in used.items() if enabled)
        self._waiting: deque[ContactOrFlight] = deque(maxlen=_MAX_WAITING)
        self._flights: list[FreeFlight] = []
        # Contacts whose speeds are in the terms, and those that wait for a drag.
        self._counted: list[Contact] = []
        self._new: list[Contact] = []
        self._drag = 0.0
        self._terms = ContactTerms.of(())

    def push(self, contact: ContactOrFlight) -> None:
        """Add a contact or a flight; it may come before or after the speeds of that time."""
        if isinstance(contact, self._used):
            self._waiting.append(contact)

    def count(self, first_ns: int, last_ns: int) -> None:
        """Sum the contacts between the end of the shaking and 2 s before the last speed."""
        latest = last_ns - KNOWN_AFTER_NS[Rebound]
        ripe = [contact for contact in self._waiting if contact.stamp_ns <= latest]
        self._keep(lambda stamp_ns: stamp_ns > latest)
        within = [contact for contact in ripe if contact.stamp_ns >= first_ns]
        self._flights += [flight for flight in within if isinstance(flight, FreeFlight)]
        self._new += [contact for contact in within if not isinstance(contact, FreeFlight)]

    def end_at_merge(self, merge_ns: int) -> None:
        """Take out the contacts since a merge, which is known seconds later.

        Bodies rebound with the mass of all their beads, and where one turns its beads change
        their velocity without a contact.
        """
        end_ns = merge_ns - _MERGE_ERROR_NS
        self._flights = [flight for flight in self._flights if flight.stamp_ns < end_ns]
        self._new = [contact for contact in self._new if contact.stamp_ns < end_ns]
        before = [contact for contact in self._counted if contact.stamp_ns < end_ns]
        if len(before) < len(self._counted):
            self._new = before + self._new
            self._counted = []
            self._terms = ContactTerms.of(())

    def next_cycle(self) -> None:
        """Clear the sums; late contacts of the cycle before are too early to be summed."""
        self._flights, self._counted, self._new = [], [], []
        self._drag = 0.0
        self._terms = ContactTerms.of(())

    @property
    def flights(self) -> NDArray[np.float64]:
        """Table of the flights, see `flight_table`."""
        return flight_table(self._flights)

    def terms(self, drag: float) -> ContactTerms:
        """Likelihoods of the contacts, with speeds for about this drag of the gas, [1/s]."""
        if abs(drag - self._drag) > _DRAG_STEP:
            self._counted, self._new = [], self._counted + self._new
            self._drag, self._terms = drag, ContactTerms.of(())
        if self._new:
            self._terms += ContactTerms.of(dragged(contact, self._drag) for contact in self._new)
            self._counted += self._new
            self._new = []
        return self._terms

    def restart(self, stamp_ns: int) -> None:
        """Handle time that went back to a stamp: drop the sums and all later contacts."""
        self.next_cycle()
        self._keep(lambda contact_ns: contact_ns <= stamp_ns)

    def _keep(self, keep: Callable[[int], bool]) -> None:
        kept = [contact for contact in self._waiting if keep(contact.stamp_ns)]
        self._waiting.clear()
        self._waiting.extend(kept)
