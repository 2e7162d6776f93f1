"""Which source a published restitution comes from, and when decay and contacts disagree.

Tested by ``test/inference/test_restitution_sources.py``.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from nanorocks_ros.records.quality_flags import NOTHING_WRONG, Quality

if TYPE_CHECKING:
    from nanorocks_ros.records.values import Measured

AGREEMENT_TENSION = 2.45
"""Tension up to which decay and contacts are taken together: of cycles in which all is as assumed
5 % are above, since its square is the chi square of two restitutions that both determine."""
FRICTION_SIGMAS = 1.645
"""Standard deviations above 0 at which walls have friction: 5 % of smooth walls are above."""

CONTRADICTED = (
    'contacts at different speeds contradict a constant restitution, in 5 % of cycles by chance'
)
"""What the test for a restitution that depends on the speed says, and how often it is wrong."""

# Flags with which the decay does not count.
_FLAGGED = {
    Quality.ACCELERATED: 'an acceleration drives the beads',
    Quality.STICKING: 'beads stick, which the decay from then on does not allow for',
    Quality.SPEED_DEPENDENT: CONTRADICTED,
}


class Headline(IntEnum):
    """Source of a published restitution (constants of ``CorEstimate.msg``).

    The message gives each its name with ``HEADLINE_`` before it.
    """

    UNKNOWN = 0
    JOINT = 1
    CONTACTS = 2
    DECAY = 3


def is_tense(tension: float) -> bool:
    """Whether decay and contacts contradict each other."""
    return tension > AGREEMENT_TENSION


def walls_rub(friction: Measured) -> bool:
    """Whether walls have friction, so that the decay of smooth beads does not apply."""
    return friction.known and friction.value > FRICTION_SIGMAS * friction.error


def headline_of(contacts: int, tension: float, friction: Measured) -> Headline:
    """The source that can be trusted.

    Parameters
    ----------
    contacts : int
        Rebounds and collisions used.
    tension : float
        Standard deviations by which they and the decay disagree.
    friction : Measured
        Of the side walls.
    """
    if not contacts:
        return Headline.DECAY
    return Headline.CONTACTS if is_tense(tension) or walls_rub(friction) else Headline.JOINT


def reason_for_contacts(
    tension: float, friction: Measured, quality: Quality = NOTHING_WRONG
) -> str:
    """Why a restitution is that of contacts alone; empty where the decay agrees."""
    reasons = [text for flag, text in _FLAGGED.items() if flag in quality]
    if is_tense(tension):
        reasons.append(f'decay and contacts differ by {tension:.1f} standard deviations')
    if walls_rub(friction):
        reasons.append(
            f'rebounds show a friction of {friction.value:.3f} +- {friction.error:.3f}, which '
            'slows the gas as less restitution would'
        )
    return ' and '.join(reasons)


def headline_in_words(
    headline: Headline, tension: float, friction: Measured, quality: Quality = NOTHING_WRONG
) -> str:
    """The source of a restitution in a phrase, with the reason where it is not all there is."""
    smooth = ', of beads that count as smooth' if Quality.FRICTION_UNKNOWN in quality else ''
    match headline:
        case Headline.JOINT:
            return f'decay and contacts together{smooth}'
        case Headline.CONTACTS:
            reason = reason_for_contacts(tension, friction, quality)
            return 'contacts alone' + (f', since {reason}' if reason else '')
        case Headline.DECAY:
            return f'decay alone{smooth}'
        case _:
            return 'unknown'
