"""Rebounds and collisions of the cycle that is cooling: which of them count, and what they say."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.records import PairCollision, Rebound
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS

if TYPE_CHECKING:
    from collections.abc import Callable

    from nanorocks_ros.settings import CoolingSettings

# Between two windows contacts come that nobody asks for.
_MOST_WAITING = 5000


class ContactsOfCycle:
    """Gathers the contacts from the end of the shaking to that of the cooling window.

    One is known a second and a half after it happened. Those of the last two seconds before the
    last speed never count: so it does not matter in which order speeds and contacts come in.

    Parameters
    ----------
    settings : CoolingSettings
        Which kinds are used.
    """

    def __init__(self, settings: CoolingSettings) -> None:
        used = {Rebound: settings.rebounds, PairCollision: settings.collisions}
        self._used = tuple(kind for kind, wanted in used.items() if wanted)
        self._waiting: deque[Rebound | PairCollision] = deque(maxlen=_MOST_WAITING)
        self.terms = ContactTerms.of(())

    def push(self, contact: Rebound | PairCollision) -> None:
        """Take a contact, before or after the speeds of that time."""
        if isinstance(contact, self._used):
            self._waiting.append(contact)

    def count(self, first_ns: int, last_ns: int) -> None:
        """Count those between the end of the shaking and the last speed so far."""
        latest = last_ns - KNOWN_AFTER_NS[Rebound]
        ripe = [one for one in self._waiting if one.stamp_ns <= latest]
        self._keep(lambda stamp_ns: stamp_ns > latest)
        within = [one for one in ripe if one.stamp_ns >= first_ns]
        if within:
            self.terms += ContactTerms.of(within)

    def next_cycle(self) -> None:
        """Begin anew; contacts of the cycle before may still come in, and are too early then."""
        self.terms = ContactTerms.of(())

    def restart(self, stamp_ns: int) -> None:
        """Time went back to this stamp: what is later comes from before that."""
        self.next_cycle()
        self._keep(lambda its_ns: its_ns <= stamp_ns)

    def _keep(self, wanted: Callable[[int], bool]) -> None:
        kept = [one for one in self._waiting if wanted(one.stamp_ns)]
        self._waiting.clear()
        self._waiting.extend(kept)
