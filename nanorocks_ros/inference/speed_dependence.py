"""Whether the restitutions of a tray depend on the impact speed, by its contacts.

Tested by ``test/inference/test_speed_dependence.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from nanorocks_ros.records import Interval
from nanorocks_ros.records.headlines import walls_rub

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
    from nanorocks_ros.inference.contacts.restitution_exponent import RestitutionExponent
    from nanorocks_ros.inference.contacts.restitution_law import RestitutionLaw
    from nanorocks_ros.inference.flights.flight_losses import FlightLosses
    from nanorocks_ros.settings import PriorSettings

# Largest chance of an exponent by which a restitution depends on speed. Each kind of contacts is
# tested, but intervals are rather too wide: at most 5 % of gases of constant restitution have a
# smaller one in either (`python -m benchmarks speed_dependence`).
_MAX_CHANCE = 0.05
# Largest exponent of a law that is not certain: those of known materials are 0 to 0.6. All up to
# it together are as likely as a constant restitution, before contacts are seen.
_HIGHEST_EXPONENT = 0.75
# Of the contacts of an estimate before.
_MORE = 1.1


class SpeedDependence(NamedTuple):
    """How the restitutions of beads and of walls depend on speed; None from too few contacts."""

    beads: RestitutionExponent | None = None
    walls: RestitutionExponent | None = None

    @property
    def is_seen(self) -> bool:
        """Whether any kind of contacts shows a dependence; wrong in 5 % of constant gases."""
        return any(kind is not None and kind.chance < _MAX_CHANCE for kind in self)

    @property
    def bead_weight(self) -> float:
        """Probability of the law of the beads against a constant restitution.

        1 where the test rejects that; 0 without a law.
        """
        beads = self.beads
        if beads is None or self.bead_law is None:
            return 0.0
        if beads.chance < _MAX_CHANCE:
            return 1.0
        return beads.law_probability(_HIGHEST_EXPONENT)

    @property
    def bead_law(self) -> RestitutionLaw | None:
        """The law of the beads: of any exponent where it is certain, else of known materials."""
        if self.beads is None or self.beads.chance < _MAX_CHANCE:
            return None if self.beads is None else self.beads.law
        return self.beads.law.up_to(_HIGHEST_EXPONENT)

    @property
    def wall_weight(self) -> float:
        """Whether the walls follow their law, 1 or 0."""
        return 1.0 if self.walls is not None and self.walls.chance < _MAX_CHANCE else 0.0

    def fields(self, ends: NDArray[np.float64], narrow: NDArray[np.float64]) -> dict[str, Any]:
        """The fields of `CycleRestitution` and `MeanRestitution` that say so.

        Parameters
        ----------
        ends : ndarray (3,)
            Probabilities of lower end, value and upper end.
        narrow : ndarray (3,)
            The same of an interval of 68 %.
        """
        fields: dict[str, Any] = {'speed_dependent': self.is_seen}
        for prefix, kind in (('', self.beads), ('wall_', self.walls)):
            if kind:
                fields[f'{prefix}restitution_exponent'] = kind.interval(ends)
                inner = kind.interval(narrow)
                fields[f'{prefix}restitution_exponent_lower_68'] = inner.lower
                fields[f'{prefix}restitution_exponent_upper_68'] = inner.upper
                fields[f'{prefix}impact_speed'] = kind.speed
                lower, value, upper = kind.law.at(kind.speed).quantiles(ends).tolist()
                fields[f'{prefix}impact_restitution'] = Interval(value, lower, upper)
        return fields


def speed_dependence(
    contacts: ContactTerms, losses: FlightLosses, prior: PriorSettings
) -> SpeedDependence:
    """Compare contacts at different speeds.

    Parameters
    ----------
    contacts : ContactTerms
    losses : FlightLosses
        What slows beads between contacts; by friction only where walls rub.
    prior : PriorSettings
        Its systematic errors of contacts may be this much more for each factor e in speed.
    """
    rubbed = walls_rub(contacts.wall_friction)
    slowing = losses.rubbed if rubbed else losses.slowing
    return SpeedDependence(
        beads=contacts.bead_exponent(prior.collision_bias, slowing),
        walls=contacts.wall_exponent(prior.rebound_bias, slowing),
    )


class RunningDependence:
    """The dependence while a cycle cools: compared anew where there are a tenth more contacts."""

    def __init__(self) -> None:
        self._contacts = 0
        self._last = SpeedDependence()

    def of(
        self, contacts: ContactTerms, losses: FlightLosses, prior: PriorSettings, *, final: bool
    ) -> SpeedDependence:
        """The dependence by the contacts so far, or of a moment ago.

        Parameters
        ----------
        contacts : ContactTerms
        losses : FlightLosses
        prior : PriorSettings
        final : bool
            By all contacts of the cycle; the next one is another cycle.
        """
        number = contacts.rebounds + contacts.collisions
        if final or not self._contacts <= number < _MORE * self._contacts:
            self._contacts = number
            self._last = speed_dependence(contacts, losses, prior)
        return self._last
