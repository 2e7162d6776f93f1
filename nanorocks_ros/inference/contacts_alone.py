"""Restitutions from rebounds and collisions alone: no decay, no library, no shaking event."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import (
    marginal,
    pair_table,
    rebound_table,
)
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import (
    dragged,
    loss_beside_contacts,
    loss_sums,
)
from nanorocks_ros.inference.contacts.rebound_reading import AS_SEEN, rebound_reading
from nanorocks_ros.inference.flights.flight_losses import (
    MIN_FLIGHTS,
    Slowing,
    flight_losses,
    flight_table,
)
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.inference.wall_likelihoods import walls_of_either, walls_of_rolling
from nanorocks_ros.records import (
    ONE_SIGMA,
    UNKNOWN,
    UNKNOWN_MEASURED_INTERVAL,
    FreeFlight,
    Measured,
    MeasuredInterval,
    PairCollision,
    Rebound,
    walls_rub,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.likelihood_1d import Posterior1D
    from nanorocks_ros.settings import PriorSettings

# A single contact determines a restitution to 0.003 at best.
_GRID = np.linspace(0.0, 1.0, 1001)
# Largest standard deviation of a restitution that is given: a flat one from 0 to 1 has 0.29.
_LARGEST_DEVIATION = 0.2
# Walls with friction are compared with restitutions from 0.5 on.
_LOWEST_RUBBED = 0.55


@dataclass(frozen=True, slots=True, kw_only=True)
class RestitutionOfContacts:
    """A restitution from single contacts of one kind.

    Parameters
    ----------
    contacts : int
        Their number.
    restitution : MeasuredInterval
        Mean, standard deviation and interval of the posterior for a flat prior from 0 to 1;
        unknown where the contacts do not determine it.
    speed : float, [m/s]
        Median speed along the normal before the contacts; NaN without any.
    lower_68, upper_68 : float
        Ends of the interval with the probability `ONE_SIGMA`.
    """

    contacts: int
    restitution: MeasuredInterval = UNKNOWN_MEASURED_INTERVAL
    speed: float = float('nan')
    lower_68: float = float('nan')
    upper_68: float = float('nan')


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactsAlone:
    """What the contacts of a recording say.

    Parameters
    ----------
    beads, walls : RestitutionOfContacts
        Between beads, and between beads and side walls.
    by_wall : dict of int to RestitutionOfContacts
        Of each side wall with rebounds: 0 to 3, low and high along columns, along rows.
    drag : Measured, [1/s]
        Of the gas, which the speeds are corrected for; the prior where few flights were seen.
    """

    beads: RestitutionOfContacts
    walls: RestitutionOfContacts
    by_wall: dict[int, RestitutionOfContacts]
    drag: Measured


def contacts_alone(
    contacts: Iterable[Rebound | PairCollision],
    flights: Iterable[FreeFlight],
    prior: PriorSettings,
    probability: float = 0.95,
    *,
    sides: tuple[float, float] | None = None,
    height_known: bool = True,
    each_wall: bool = True,
) -> ContactsAlone:
    """Restitutions from contacts in any state of motion: cooling, driven, steady.

    Parameters
    ----------
    contacts : iterable of Rebound or PairCollision
    flights : iterable of FreeFlight
        Between them: they show the drag of the gas.
    prior : PriorSettings
        Systematic errors of contacts, and what is known of the drag.
    probability : float
        Of the intervals.
    sides : tuple of 2 floats or None, [m]
        Of the tray: rebounds tell how it is read (`rebound_reading`). None: they count as seen.
    height_known : bool
        Whether the height of the tray is; where walls rub floor and lid then do as well.
    each_wall : bool
        Whether each wall is wanted as well.
    """
    losses = flight_losses(flight_table(flights), Measured(prior.drag, prior.drag_error))
    # With fewer flights the prior alone would speak, which is that of a gas at low pressure.
    is_measured = losses.flights >= MIN_FLIGHTS
    slowing = losses.slowing if is_measured else Slowing.by_drag(Measured(prior.drag, 0.0))
    own = [_complete(dragged(contact, slowing.drag.value)) for contact in contacts]
    rebounds = [contact for contact in own if isinstance(contact, Rebound)]
    reading = AS_SEEN
    if sides is not None:
        reading = rebound_reading(rebounds, sides, prior.readout, walls_alike=False)
        rebounds = [reading.read(rebound) for rebound in rebounds]
    bias = math.hypot(prior.rebound_bias, reading.error)
    collisions = [
        contact
        for contact in own
        if isinstance(contact, PairCollision) and np.isfinite(contact.temperatures).all()
    ]

    def terms_of(some: Sequence[Rebound]) -> ContactTerms:
        return replace(ContactTerms.of(some), reading_error=reading.error)

    numbers = sorted({rebound.wall for rebound in rebounds}) if each_wall else []
    # Floor and lid rub as the walls do, which all rebounds tell together.
    friction = terms_of(rebounds) if height_known and is_measured else None

    def walls(some: Sequence[Rebound]) -> RestitutionOfContacts:
        speeds = [rebound.incoming.value for rebound in some]
        table = rebound_table(some, _GRID)
        smooth = _restitution(table, some, speeds, (slowing, bias, probability))
        if friction is None or not smooth.restitution.lower > _LOWEST_RUBBED:
            return smooth
        own = friction if len(some) == len(rebounds) else terms_of(some)
        likelihood = walls_of_rolling(own, prior, losses, friction)
        if walls_rub(friction.wall_friction):
            likelihood = walls_of_either(own, prior, losses, likelihood, friction)
        if likelihood is None:
            return smooth
        return _of_posterior(likelihood.posterior((0.5, 1.0)), len(some), speeds, probability)

    return ContactsAlone(
        beads=_restitution(
            pair_table(collisions, _GRID[::10]),
            collisions,
            [pair.normal_speeds[0] for pair in collisions],
            (slowing, prior.collision_bias, probability),
        ),
        walls=walls(rebounds),
        by_wall={
            number: walls([rebound for rebound in rebounds if rebound.wall == number])
            for number in numbers
        },
        drag=losses.of_first_species(losses.drag),
    )


def _complete(contact: Rebound | PairCollision) -> Rebound | PairCollision:
    """The contact; without friction beside it where no speed is known of that time."""
    return contact if contact.friction_length >= 0.0 else replace(contact, friction_length=0.0)


def _restitution(
    table: NDArray[np.float64],
    contacts: Sequence[Rebound | PairCollision],
    speeds: Sequence[float],
    conditions: tuple[Slowing, float, float],
) -> RestitutionOfContacts:
    """The posterior of contacts of one kind; `conditions` are slowing, bias and probability."""
    if not contacts:
        return RestitutionOfContacts(contacts=0)
    slowing, bias, probability = conditions
    grid = np.linspace(0.0, 1.0, table.shape[1])
    likelihood = Likelihood1D(restitution=grid, log_likelihood=marginal(table))
    best = float(grid[np.argmax(likelihood.log_likelihood)])
    loss = loss_beside_contacts(loss_sums(contacts), slowing)
    slowed = likelihood.shifted(best * float(np.expm1(loss.value)))
    posterior = slowed.convolved(float(np.hypot(bias, best * loss.error))).posterior((0.0, 1.0))
    return _of_posterior(posterior, len(contacts), speeds, probability)


def _of_posterior(
    posterior: Posterior1D, contacts: int, speeds: Sequence[float], probability: float
) -> RestitutionOfContacts:
    halves = 0.5 * np.array([-probability, probability, -ONE_SIGMA, ONE_SIGMA])
    lower, upper, lower_68, upper_68 = posterior.quantiles(0.5 + halves).tolist()
    known = posterior.deviation <= _LARGEST_DEVIATION
    value = MeasuredInterval(posterior.mean, posterior.deviation, lower, upper)
    return RestitutionOfContacts(
        contacts=contacts,
        restitution=value if known else UNKNOWN_MEASURED_INTERVAL,
        speed=float(np.median(speeds)),
        lower_68=lower_68 if known else UNKNOWN,
        upper_68=upper_68 if known else UNKNOWN,
    )
