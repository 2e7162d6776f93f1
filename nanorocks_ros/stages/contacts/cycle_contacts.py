"""Rebounds and collisions of the current cooling cycle, summed for the restitution fit.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.records import PairCollision, Rebound
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS

if TYPE_CHECKING:
    from collections.abc import Callable

    from nanorocks_ros.settings import CoolingSettings

# Between two cooling windows contacts come in that no fit uses.
_MAX_WAITING = 5000
# Error of the time of a merge, [ns]: the contact that made the body may be dated before it.
_MERGE_ERROR_NS = 100_000_000


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
        used = {Rebound: settings.rebounds, PairCollision: settings.collisions}
        self._used = tuple(kind for kind, enabled in used.items() if enabled)
        self._waiting: deque[Rebound | PairCollision] = deque(maxlen=_MAX_WAITING)
        self._counted: list[Rebound | PairCollision] = []
        self.terms = ContactTerms.of(())

    def push(self, contact: Rebound | PairCollision) -> None:
        """Add a contact; it may come before or after the speeds of that time."""
        if isinstance(contact, self._used):
            self._waiting.append(contact)

    def count(self, first_ns: int, last_ns: int) -> None:
        """Sum the contacts between the end of the shaking and 2 s before the last speed."""
        latest = last_ns - KNOWN_AFTER_NS[Rebound]
        ripe = [contact for contact in self._waiting if contact.stamp_ns <= latest]
        self._keep(lambda stamp_ns: stamp_ns > latest)
        within = [contact for contact in ripe if contact.stamp_ns >= first_ns]
        if within:
            self._counted += within
            self.terms += ContactTerms.of(within)

    def end_at_merge(self, merge_ns: int) -> None:
        """Take out the contacts since a merge, which is known seconds later.

        Bodies rebound with the mass of all their beads, and where one turns its beads change
        their velocity without a contact.
        """
        kept = [
            contact for contact in self._counted if contact.stamp_ns < merge_ns - _MERGE_ERROR_NS
        ]
        if len(kept) < len(self._counted):
            self._counted, self.terms = kept, ContactTerms.of(kept)

    def next_cycle(self) -> None:
        """Clear the sums; late contacts of the cycle before are too early to be summed."""
        self._counted = []
        self.terms = ContactTerms.of(())

    def restart(self, stamp_ns: int) -> None:
        """Handle time that went back to a stamp: drop the sums and all later contacts."""
        self.next_cycle()
        self._keep(lambda contact_ns: contact_ns <= stamp_ns)

    def _keep(self, keep: Callable[[int], bool]) -> None:
        kept = [contact for contact in self._waiting if keep(contact.stamp_ns)]
        self._waiting.clear()
        self._waiting.extend(kept)
