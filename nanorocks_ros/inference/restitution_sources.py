"""Restitutions from the decay, from contacts and from both, and which of them can be trusted.

The likelihood of the decay holds for smooth spheres in a vacuum. Contacts test it: where they
contradict it, or show that walls rub, only the contacts are believed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_terms import NO_SLOWING
from nanorocks_ros.inference.posterior import Posterior, posterior_of
from nanorocks_ros.inference.speed_dependence import SpeedDependence
from nanorocks_ros.inference.wall_likelihoods import walls_of_either, walls_of_rolling
from nanorocks_ros.records import (
    UNKNOWN_INTERVAL,
    UNKNOWN_MEASURED,
    Headline,
    Interval,
    Measured,
    headline_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
    from nanorocks_ros.inference.decay.decay_tables import DecayTables
    from nanorocks_ros.inference.flights.flight_losses import FlightLosses
    from nanorocks_ros.inference.likelihood_1d import Posterior1D
    from nanorocks_ros.settings import PriorSettings

NO_DEPENDENCE = SpeedDependence()
"""Of restitutions that are not compared at different speeds."""

# Of its loss by which a restitution reads high, and by how much that may differ, where decay and
# contacts of a gas that depends on speed are read as those of a constant one: 0.11 to 0.13 at an
# exponent of 0.2, 0.24 to 0.25 at 0.6 (`python -m benchmarks speed_headlines`).
_TOO_HIGH, _SPREAD_BY_LAW = 0.12, 0.15


@dataclass(frozen=True, kw_only=True)
class RestitutionSources:
    """What decay and contacts say about both restitutions, alone and together.

    Parameters
    ----------
    joint, decay : Posterior
    beads, walls : Posterior1D or None
        From collisions and from rebounds alone; None without any.
    wall_friction : Measured
    headline : Headline
    drag : Measured, [1/s]
        With friction beside it where contacts are believed alone.
    dependence : SpeedDependence
        Where contacts show laws of the impact speed, these are the restitutions of the headline,
        weighted by energy; where they need not, that of the beads has its share.
    """

    joint: Posterior
    decay: Posterior
    beads: Posterior1D | None
    walls: Posterior1D | None
    wall_friction: Measured
    headline: Headline
    drag: Measured
    dependence: SpeedDependence

    def contact_intervals(self, ends: NDArray[np.float64]) -> tuple[Interval, Interval]:
        """Of beads and walls by contacts alone; unknown without contacts of the kind."""
        return _interval(self.beads, ends), _interval(self.walls, ends)

    def intervals(self, ends: NDArray[np.float64]) -> tuple[Interval, Interval]:
        """Of beads and walls by the source of the headline.

        Parameters
        ----------
        ends : ndarray (3,)
            Probabilities of lower end, value and upper end.
        """
        if self.headline is Headline.CONTACTS:
            beads, walls = self.contact_intervals(ends)
        else:
            beads, walls = intervals_of(self.joint, ends)
        by_law, walls_by_law = self._laws
        return (
            beads if by_law is None else _interval(by_law, ends),
            walls if walls_by_law is None else _interval(walls_by_law, ends),
        )

    @property
    def means(self) -> tuple[Measured, Measured]:
        """Mean and standard deviation of beads and walls by the source of the headline."""
        if self.headline is Headline.CONTACTS:
            means = _mean(self.beads), _mean(self.walls)
        else:
            errors = np.sqrt(np.diag(self.joint.covariance)).tolist()
            beads, walls = zip(self.joint.mean, errors, strict=True)
            means = Measured(*beads), Measured(*walls)
        by_law, walls_by_law = self._laws
        return (
            means[0] if by_law is None else _mean(by_law),
            means[1] if walls_by_law is None else _mean(walls_by_law),
        )

    @cached_property
    def _laws(self) -> tuple[Posterior1D | None, Posterior1D | None]:
        """Restitutions of beads and walls where their laws count; None where they do not."""
        dependence, by_law, walls_by_law = self.dependence, None, None
        if dependence.bead_law is not None and dependence.bead_weight > 0.0:
            by_law = dependence.bead_law.energy_weighted
            constant = self.beads
            if self.headline is not Headline.CONTACTS:
                constant = self.joint.beads
            if dependence.bead_weight < 1.0 and constant is not None:
                if self.headline is not Headline.CONTACTS:
                    loss = 1.0 - constant.mean
                    by_law = by_law.weighted(
                        constant.mean - _TOO_HIGH * loss,
                        math.hypot(constant.deviation, _SPREAD_BY_LAW * loss),
                    )
                by_law = constant.mixed_with(by_law, dependence.bead_weight)
        if dependence.walls is not None and dependence.wall_weight > 0.0:
            walls_by_law = dependence.walls.law.energy_weighted
        return by_law, walls_by_law

    @property
    def correlation(self) -> float:
        """Of both restitutions by the source of the headline; contacts have none."""
        spread = self.joint.covariance
        product = math.sqrt(spread[0, 0] * spread[1, 1])
        if self.headline is Headline.CONTACTS or not product > 0.0:
            return 0.0
        return float(spread[0, 1]) / product


def restitution_sources(
    tables: DecayTables,
    log_likelihood: NDArray[np.float64],
    contacts: ContactTerms,
    prior: PriorSettings,
    *,
    decay_counts: bool = True,
    losses: FlightLosses | None = None,
    dependence: SpeedDependence = NO_DEPENDENCE,
) -> RestitutionSources:
    """Restitutions by each source.

    Parameters
    ----------
    tables : DecayTables
    log_likelihood : ndarray (n_places,)
        Of the decay, on the grid of the tables.
    contacts : ContactTerms
    prior : PriorSettings
    decay_counts : bool
        False where the log likelihood holds no decay that can be trusted.
    losses : FlightLosses, optional
        What slows beads between contacts, where flights were seen. Walls are always read with the
        friction of floor and lid that rebounds and flights tell; beads only where contacts are
        believed alone: that widens their intervals.
    dependence : SpeedDependence, optional
        Of the contacts; the decay does not count where it is seen.

    Raises
    ------
    ConfigurationError
        For a wall prior outside the range of the library.
    """
    walls = prior.min_wall_restitution, prior.max_wall_restitution
    slowing = losses.slowing if losses else NO_SLOWING
    bead_likelihood = contacts.bead_likelihood(prior.collision_bias, slowing)
    wall_likelihood = walls_of_rolling(contacts, prior, losses)
    joint = posterior_of(
        tables,
        log_likelihood,
        walls,
        bead_likelihood=bead_likelihood,
        wall_likelihood=wall_likelihood,
    )
    number = contacts.rebounds + contacts.collisions
    friction = contacts.wall_friction
    headline = headline_of(number, joint.tension, friction)
    if dependence.is_seen or not decay_counts:
        headline = Headline.CONTACTS
    drag = losses.drag if losses else UNKNOWN_MEASURED
    if headline is Headline.CONTACTS:
        slowing = losses.rubbed if losses else NO_SLOWING
        drag = slowing.drag if losses else UNKNOWN_MEASURED
        bead_likelihood = contacts.bead_likelihood(prior.collision_bias, slowing)
        wall_likelihood = walls_of_either(contacts, prior, losses, wall_likelihood)
    return RestitutionSources(
        joint=joint,
        decay=posterior_of(tables, log_likelihood, walls) if number else joint,
        beads=bead_likelihood.posterior((0.0, 1.0)) if bead_likelihood else None,
        walls=wall_likelihood.posterior(walls) if wall_likelihood else None,
        wall_friction=friction,
        headline=headline,
        drag=losses.of_first_species(drag) if losses else drag,
        dependence=dependence,
    )


def intervals_of(posterior: Posterior, ends: NDArray[np.float64]) -> tuple[Interval, Interval]:
    """The restitution of two beads, and of beads and walls; `ends` as for the sources."""
    lower, value, upper = posterior.quantiles(ends).tolist()
    wall_lower, wall, wall_upper = posterior.wall_quantiles(ends).tolist()
    return Interval(value, lower, upper), Interval(wall, wall_lower, wall_upper)


def _interval(posterior: Posterior1D | None, ends: NDArray[np.float64]) -> Interval:
    if posterior is None:
        return UNKNOWN_INTERVAL
    lower, value, upper = posterior.quantiles(ends).tolist()
    return Interval(value, lower, upper)


def _mean(posterior: Posterior1D | None) -> Measured:
    return UNKNOWN_MEASURED if posterior is None else Measured(posterior.mean, posterior.deviation)
