"""Log-likelihood tables of all rebounds and collisions of some cycles, which add up."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import (
    ERROR_SCALES,
    MIDDLE_NUISANCE,
    marginal,
    pair_table,
    rebound_table,
)
from nanorocks_ros.inference.contacts.dragged_contacts import loss_beside_contacts, loss_sums
from nanorocks_ros.inference.contacts.impact_bins import speed_bins
from nanorocks_ros.inference.contacts.impact_likelihoods import CollisionImpacts, ReboundImpacts
from nanorocks_ros.inference.contacts.impact_tables import collision_impacts, rebound_impacts
from nanorocks_ros.inference.contacts.restitution_exponent import bead_exponent, wall_exponent
from nanorocks_ros.inference.contacts.rubbed_rebounds import ROLLING, rubbed_likelihood
from nanorocks_ros.inference.contacts.wall_friction import (
    friction_likelihood,
    friction_table,
    wall_friction,
)
from nanorocks_ros.inference.flights.flight_losses import Slowing
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.records import UNKNOWN_MEASURED, Measured, PairCollision, Rebound

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.impact_bins import SpeedBin
    from nanorocks_ros.inference.contacts.restitution_exponent import RestitutionExponent

_LOWEST_REBOUND = 0.5
"""Lowest restitution of the walls for which rebounds are compared."""

NO_SLOWING = Slowing.by_drag(Measured(0.0, 0.0))
"""Between contacts in a vacuum, and without friction."""

# A single contact determines the bead restitution to 0.02 and the wall restitution to 0.003 at
# best: a spline through these nodes represents sums of log likelihoods.
BEADS = np.linspace(0.0, 1.0, 101)
"""Restitutions of beads at which collisions are compared."""
_WALLS = np.linspace(_LOWEST_REBOUND, 1.0, 501)


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
    friction : ndarray (m, n)
        Table of `friction_table`.
    rebound_losses, collision_losses : ndarray (4,)
        Sums of `loss_sums`.
    rebound_impacts, collision_impacts : ndarray (n, columns)
        Rows of `rebound_impacts` and `collision_impacts`.
    reading_error : float
        Standard deviation of the wall restitution that all rebounds have in common, by how they
        are read.
    """

    rebounds: int
    collisions: int
    walls: NDArray[np.float64]
    beads: NDArray[np.float64]
    friction: NDArray[np.float64]
    rebound_losses: NDArray[np.float64]
    collision_losses: NDArray[np.float64]
    rebound_impacts: NDArray[np.float64]
    collision_impacts: NDArray[np.float32]
    reading_error: float = 0.0

    @classmethod
    def of(
        cls, contacts: Iterable[Rebound | PairCollision], sticking_speed: float = 0.0
    ) -> ContactTerms:
        """Tables of some contacts; 0 everywhere without contacts.

        Parameters
        ----------
        contacts : iterable of Rebound or PairCollision
        sticking_speed : float, [m/s]
            Beads with a smaller impact speed merge, so that their collisions are missing.
        """
        contacts = list(contacts)
        rebounds = [contact for contact in contacts if isinstance(contact, Rebound)]
        collisions = [contact for contact in contacts if isinstance(contact, PairCollision)]
        return cls(
            rebounds=len(rebounds),
            collisions=len(collisions),
            walls=rebound_table(rebounds, _WALLS),
            beads=pair_table(collisions, BEADS, sticking_speed=sticking_speed),
            friction=friction_table(rebounds),
            rebound_losses=loss_sums(rebounds),
            collision_losses=loss_sums(collisions),
            rebound_impacts=rebound_impacts(rebounds),
            collision_impacts=collision_impacts(collisions, sticking_speed),
        )

    def __add__(self, other: ContactTerms) -> ContactTerms:
        return ContactTerms(
            rebounds=self.rebounds + other.rebounds,
            collisions=self.collisions + other.collisions,
            walls=self.walls + other.walls,
            beads=self.beads + other.beads,
            friction=self.friction + other.friction,
            rebound_losses=self.rebound_losses + other.rebound_losses,
            collision_losses=self.collision_losses + other.collision_losses,
            rebound_impacts=np.concatenate([self.rebound_impacts, other.rebound_impacts]),
            collision_impacts=np.concatenate([self.collision_impacts, other.collision_impacts]),
            # A camera, or a codec, errs alike in all cycles.
            reading_error=(
                self.rebounds * self.reading_error + other.rebounds * other.reading_error
            )
            / max(self.rebounds + other.rebounds, 1),
        )

    def read_again(self, rebounds: Sequence[Rebound], error: float) -> ContactTerms:
        """The same contacts with other speeds of the rebounds, as `ReboundReading` reads them.

        What they tell of friction stays: it goes by the sum of both speeds, and a reading takes
        from one what it adds to the other.
        """
        return replace(
            self,
            walls=rebound_table(rebounds, _WALLS),
            rebound_losses=loss_sums(rebounds),
            rebound_impacts=rebound_impacts(rebounds),
            reading_error=error,
        )

    @property
    def wall_friction(self) -> Measured:
        """Coefficient of friction of the side walls, from rebounds; unknown without any."""
        return wall_friction(self.friction) if self.friction.any() else UNKNOWN_MEASURED

    @property
    def friction_likelihood(self) -> Likelihood1D | None:
        """Log likelihood of the friction that rebounds of free beads show; None without any."""
        return friction_likelihood(self.friction) if self.friction.any() else None

    def wall_likelihood(
        self, bias: float = 0.0, slowing: Slowing = NO_SLOWING
    ) -> Likelihood1D | None:
        """Log likelihood of the wall restitution from rebounds; None without rebounds.

        Parameters
        ----------
        bias : float
            Standard deviation of a systematic error common to all of them.
        slowing : Slowing, optional
            What slows beads between contacts.
        """
        if not self.rebounds:
            return None
        term = Likelihood1D(restitution=_WALLS, log_likelihood=marginal(self.walls))
        bias = math.hypot(bias, self.reading_error)
        return _slowed(term, loss_beside_contacts(self.rebound_losses, slowing), bias)

    def rubbed_wall_likelihood(
        self,
        bias: float,
        slowing: Slowing,
        friction: tuple[NDArray[np.float64], NDArray[np.float64]],
        share: float = ROLLING,
    ) -> Likelihood1D | None:
        """Log likelihood of the wall restitution where floor and lid may rub.

        Parameters
        ----------
        bias : float
            As of `wall_likelihood`.
        slowing : Slowing
            Drag and friction rate as flights tell them.
        friction : tuple of 2 ndarrays (n,)
            Frictions of floor and lid, and their probabilities.
        share : float
            Of the full loss that hits take off.
        """
        if not self.rebounds:
            return None
        likelihood = rubbed_likelihood(self.rebound_impacts, slowing, friction, share)
        return likelihood.convolved(math.hypot(bias, self.reading_error))

    def bead_likelihood(
        self, bias: float = 0.0, slowing: Slowing = NO_SLOWING
    ) -> Likelihood1D | None:
        """Log likelihood of the bead restitution from collisions, as `wall_likelihood`."""
        if not self.collisions:
            return None
        term = Likelihood1D(restitution=BEADS, log_likelihood=marginal(self.beads))
        return _slowed(term, loss_beside_contacts(self.collision_losses, slowing), bias)

    def wall_exponent(
        self, bias: float = 0.0, slowing: Slowing = NO_SLOWING
    ) -> RestitutionExponent | None:
        """How the wall restitution depends on speed; None from too few rebounds.

        Parameters
        ----------
        bias : float
            Standard deviation of an error of the restitution that grows by this per factor e in
            speed.
        slowing : Slowing, optional
            What slows beads between contacts.
        """
        return wall_exponent(self.rebound_impacts, self._error_scale, slowing, bias)

    def bead_exponent(
        self, bias: float = 0.0, slowing: Slowing = NO_SLOWING
    ) -> RestitutionExponent | None:
        """How the bead restitution depends on speed, as `wall_exponent`.

        Radii and vertical speeds, which the exponent takes for known, correct its law as much as
        they do a constant restitution.
        """
        exponent = bead_exponent(self.collision_impacts, slowing, bias)
        if exponent is None:
            return None
        return replace(exponent, law=exponent.law.corrected(*self._bead_correction))

    def wall_bins(
        self, ends: NDArray[np.float64], slowing: Slowing = NO_SLOWING
    ) -> tuple[SpeedBin, ...]:
        """Wall restitution in ranges of the impact speed, see `speed_bins`."""
        impacts = ReboundImpacts(self.rebound_impacts, self._error_scale)
        return speed_bins(impacts, slowing, ends)

    def bead_bins(
        self, ends: NDArray[np.float64], slowing: Slowing = NO_SLOWING
    ) -> tuple[SpeedBin, ...]:
        """Bead restitution in ranges of the impact speed, see `speed_bins`."""
        impacts = CollisionImpacts(self.collision_impacts)
        return speed_bins(impacts, slowing, ends, self._bead_correction[0])

    @property
    def _error_scale(self) -> float:
        """Most likely factor on the errors of rebounds."""
        return ERROR_SCALES[int(np.argmax(self.walls.max(axis=1)))]

    @property
    def _bead_correction(self) -> tuple[float, float]:
        """What radii and vertical speeds change: a factor on the losses, and a spread."""
        known, unknown = (
            Likelihood1D(restitution=BEADS, log_likelihood=logs).posterior((0.0, 1.0))
            for logs in (self.beads[MIDDLE_NUISANCE], marginal(self.beads))
        )
        spread = math.sqrt(max(unknown.deviation**2 - known.deviation**2, 0.0))
        return (1.0 - unknown.mean) / (1.0 - known.mean), spread


def _slowed(term: Likelihood1D, loss: Measured, bias: float) -> Likelihood1D:
    """A likelihood where speeds were lost beside contacts, and with a systematic error."""
    best = float(term.restitution[np.argmax(term.log_likelihood)])
    return term.shifted(best * math.expm1(loss.value)).convolved(
        math.hypot(bias, best * loss.error)
    )
