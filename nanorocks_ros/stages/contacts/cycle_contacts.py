"""Rebounds, collisions and flights of the current cooling cycle, for the restitution fit.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.contacts.rebound_reading import AS_SEEN
from nanorocks_ros.inference.flights.flight_losses import flight_table
from nanorocks_ros.inference.sticking.bounce_tables import SPEEDS, BounceTables
from nanorocks_ros.records import FreeFlight, PairCollision, Rebound
from nanorocks_ros.stages.contacts.bound_beads import bound_since, is_free
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.rebound_reading import ReboundReading
    from nanorocks_ros.records import Contact, ContactOrFlight, Merge
    from nanorocks_ros.settings import CoolingSettings

# Between two cooling windows contacts come in that no fit uses.
_MAX_WAITING = 5000
# Change of the drag from which on the speeds of all contacts are corrected again, [1/s]; a smaller
# one shifts their likelihood.
_DRAG_STEP = 0.003
# Rebounds of free beads from which on those of bodies do not count: floor and lid, which turn
# bodies unseen, do not disturb them.
_ENOUGH_FREE = 10


class CycleContacts:
    """Sums the contacts from the end of the shaking to the end of the cooling window.

    A contact is known 1.5 s after it happened. Contacts of the last 2 s before the last speed are
    not used: the result does not depend on the order in which speeds and contacts come in.

    Parameters
    ----------
    settings : CoolingSettings
        Which kinds of contacts are used.
    among_grains : bool
        Whether there are grains in the tray. Grains that are not seen hit the beads on their way:
        of 18 collisions of beads among 255 grains four were within two errors of the truth, so
        that collisions are not used there. Rebounds were: walls do not move away.
    """

    def __init__(self, settings: CoolingSettings, *, among_grains: bool = False) -> None:
        used = {
            Rebound: settings.rebounds,
            PairCollision: settings.collisions and not among_grains,
            FreeFlight: settings.rebounds or settings.collisions,
        }
        self._used = tuple(kind for kind, enabled in used.items() if enabled)
        self._waiting: deque[ContactOrFlight] = deque(maxlen=_MAX_WAITING)
        self._flights: list[FreeFlight] = []
        # Contacts whose speeds are in the terms, and those that wait for a drag.
        self._counted: list[Contact] = []
        self._new: list[Contact] = []
        self._merges: list[Merge] = []
        self._bound_since: dict[int, int] = {}
        # Probability of each of `SPEEDS`, and the median of these.
        self._sticking: NDArray[np.float64] | None = None
        self._sticking_speed = 0.0
        self._bounces: BounceTables | None = None
        self._bodies_count = True
        self.next_cycle()

    def push(self, contact: ContactOrFlight) -> None:
        """Add a contact or a flight; it may come before or after the speeds of that time."""
        if isinstance(contact, self._used):
            self._waiting.append(contact)

    def count(self, first_ns: int, last_ns: int) -> None:
        """Sum the contacts between the end of the shaking and 2 s before the last speed."""
        latest = last_ns - KNOWN_AFTER_NS[Rebound]
        ripe = [contact for contact in self._waiting if contact.stamp_ns <= latest]
        self._keep(lambda stamp_ns: stamp_ns > latest)
        within = [
            contact for contact in ripe if contact.stamp_ns >= first_ns and self._is_free(contact)
        ]
        self._flights += [flight for flight in within if isinstance(flight, FreeFlight)]
        self._new += [contact for contact in within if not isinstance(contact, FreeFlight)]

    def merge(self, merge: Merge) -> None:
        """Take out what the beads of a merge did since, which is known seconds later."""
        self._merges.append(merge)
        self._bound_since = bound_since(self._merges)
        self._flights = [flight for flight in self._flights if self._is_free(flight)]
        self._new = [contact for contact in self._new if self._is_free(contact)]
        free = [contact for contact in self._counted if self._is_free(contact)]
        if len(free) < len(self._counted):
            self._counted = free
            self._start_sums()

    def _is_free(self, contact: ContactOrFlight) -> bool:
        return is_free(contact, self._bound_since)

    def stick(self, weights: NDArray[np.float64] | None) -> None:
        """Tell below which speed beads merge, so that slower collisions are missing.

        Parameters
        ----------
        weights : ndarray (n,) or None
            Probability of each of `bounce_tables.SPEEDS`; None while no beads stick.
        """
        began = (weights is None) != (self._sticking is None)
        self._sticking = weights
        speed = 0.0
        if weights is not None:
            speed = float(SPEEDS[np.searchsorted(np.cumsum(weights), 0.5)])
        if began or speed != self._sticking_speed:
            self._sticking_speed = speed
            self._start_sums()

    def _start_sums(self) -> None:
        """Sum all contacts anew."""
        self._counted, self._new = [], self._counted + self._new
        self._terms = ContactTerms.of(())
        self._rebounds: list[Rebound] = []
        self._bounces = None

    def next_cycle(self) -> None:
        """Clear the sums; late contacts of the cycle before are too early to be summed."""
        self._flights, self._counted, self._new = [], [], []
        self._merges, self._bound_since = [], {}
        self._drag = 0.0
        self._sticking, self._sticking_speed = None, 0.0
        self._bodies_count = True
        self._start_sums()

    @property
    def flights(self) -> NDArray[np.float64]:
        """Table of the flights, see `flight_table`."""
        return flight_table(self._flights)

    def _free_rebounds(self) -> int:
        contacts = (*self._counted, *self._new)
        return sum(isinstance(each, Rebound) and not _is_of_body(each) for each in contacts)

    @property
    def body_rebounds(self) -> int:
        """Rebounds of bodies of several beads that count: none where free beads are enough."""
        contacts = (*self._counted, *self._new)
        return sum(map(_is_of_body, contacts)) if self._bodies_count else 0

    def terms(
        self,
        drag: float,
        reading_of: Callable[[Sequence[Rebound]], ReboundReading],
    ) -> ContactTerms:
        """Likelihoods of the contacts.

        Parameters
        ----------
        drag : float, [1/s]
            Of the gas, for which speeds are about right.
        reading_of : callable
            From rebounds to what they tell of how they are read.
        """
        bodies_count = self._free_rebounds() < _ENOUGH_FREE
        if abs(drag - self._drag) > _DRAG_STEP:
            self._drag = drag
            self._start_sums()
        if bodies_count != self._bodies_count:
            self._bodies_count = bodies_count
            self._start_sums()
        if self._new:
            dragged_contacts = [
                dragged(contact, self._drag)
                for contact in self._new
                if bodies_count or not _is_of_body(contact)
            ]
            self._terms += ContactTerms.of(dragged_contacts, self._sticking_speed)
            self._rebounds += [each for each in dragged_contacts if isinstance(each, Rebound)]
            if self._sticking is not None:
                collisions = [each for each in dragged_contacts if isinstance(each, PairCollision)]
                tables = BounceTables.of(collisions)
                self._bounces = tables if self._bounces is None else self._bounces + tables
            self._counted += self._new
            self._new = []
        # Each time from all of them: what is told does not depend on when it was asked before.
        reading = reading_of(self._rebounds)
        terms = self._terms
        if reading != AS_SEEN:
            again = [reading.read(each) for each in self._rebounds]
            terms = terms.read_again(again, reading.error)
        if self._sticking is None or self._bounces is None:
            return terms
        return replace(terms, beads=self._bounces.bead_table(self._sticking))

    def restart(self, stamp_ns: int) -> None:
        """Handle time that went back to a stamp: drop the sums and all later contacts."""
        self.next_cycle()
        self._keep(lambda contact_ns: contact_ns <= stamp_ns)

    def _keep(self, keep: Callable[[int], bool]) -> None:
        kept = [contact for contact in self._waiting if keep(contact.stamp_ns)]
        self._waiting.clear()
        self._waiting.extend(kept)


def _is_of_body(contact: Contact) -> bool:
    return isinstance(contact, Rebound) and contact.beads > 1
