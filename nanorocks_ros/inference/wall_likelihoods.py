"""What rebounds say of the wall restitution, where floor and lid may rub as the walls do.

Tested by ``test/inference/test_restitution_sources.py`` and
``test/inference/test_contacts_alone.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_terms import NO_SLOWING
from nanorocks_ros.inference.contacts.rubbed_rebounds import SLIDING
from nanorocks_ros.inference.decay.friction_weights import friction_weights
from nanorocks_ros.inference.flights.flight_losses import Slowing
from nanorocks_ros.numerics.log_sums import log_sum

if TYPE_CHECKING:
    from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
    from nanorocks_ros.inference.flights.flight_losses import FlightLosses
    from nanorocks_ros.inference.likelihood_1d import Likelihood1D
    from nanorocks_ros.settings import PriorSettings

# Where contacts are believed alone walls rub: the prior of their friction, whose error is that of
# walls that hardly do, is wider by this. By default 0.03 is then half as likely as 0.
_WIDER = 10.0


def walls_of_rolling(
    contacts: ContactTerms,
    prior: PriorSettings,
    losses: FlightLosses | None,
    evidence: ContactTerms | None = None,
) -> Likelihood1D | None:
    """Log likelihood of the wall restitution if beads that rub roll; None without rebounds.

    Parameters
    ----------
    contacts : ContactTerms
    prior : PriorSettings
    losses : FlightLosses or None
        What slows beads between contacts, where flights were seen.
    evidence : ContactTerms, optional
        Rebounds that tell the friction, those of other walls, too; default: `contacts`.
    """
    weights = friction_weights(prior, evidence or contacts)
    if weights is None:
        # Only where no bead rebounds by itself.
        slowing = losses.slowing if losses else NO_SLOWING
        return contacts.wall_likelihood(prior.rebound_bias, slowing)
    return contacts.rubbed_wall_likelihood(
        prior.rebound_bias,
        losses.fitted if losses else NO_SLOWING,
        (weights.friction, weights.weight),
    )


def walls_of_either(
    contacts: ContactTerms,
    prior: PriorSettings,
    losses: FlightLosses | None,
    rolling: Likelihood1D | None,
    evidence: ContactTerms | None = None,
) -> Likelihood1D | None:
    """Log likelihood where beads may as well slide at each hit, equally likely.

    Sliding beads take more hits that show, so that flights do not tell their friction.

    Parameters
    ----------
    contacts, prior, losses, evidence
        As of `walls_of_rolling`.
    rolling : Likelihood1D or None
        From there.
    """
    wide = replace(prior, friction_error=_WIDER * prior.friction_error)
    weights = friction_weights(wide, evidence or contacts)
    if weights is None or rolling is None:
        return rolling
    drag = (losses.rubbed if losses else NO_SLOWING).drag
    sliding = contacts.rubbed_wall_likelihood(
        prior.rebound_bias, Slowing.by_drag(drag), (weights.friction, weights.weight), SLIDING
    )
    if sliding is None:
        return rolling
    both = np.array([rolling.log_likelihood, sliding.log_likelihood])
    return replace(rolling, log_likelihood=log_sum(both))
