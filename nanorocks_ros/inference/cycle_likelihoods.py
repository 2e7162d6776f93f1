"""Likelihoods of both restitutions from finished cycles, which can be added and saved.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_likelihood import NUISANCE_COUNT
from nanorocks_ros.inference.decay.grid_likelihood import DecayLikelihood
from nanorocks_ros.inference.flights.flight_losses import flight_table
from nanorocks_ros.records import (
    UNKNOWN,
    UNKNOWN_INTERVAL,
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Headline,
    Interval,
    Measured,
    MeasuredInterval,
    Quality,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

_NOT_THERE = 'analyse the recording again'


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleLikelihoods:
    """Likelihoods of some cycles of one tray, by the same relation.

    The nuisances of tray, camera and start are common to all cycles, so they do not average out:
    likelihoods are added first and integrated over the nuisances last.

    Parameters
    ----------
    cycles : int
    decay : DecayLikelihood or None
        From a library; None for the closed form of the paper.
    contacts : ContactTerms or None
    by_form : tuple of (float, float)
        From the closed form: restitution and error of each cycle.
    by_contacts : int
        Cycles of which only the contacts are part.
    flights : ndarray (n, 10)
        Table of `flight_table`: with the drag of all cycles together their contacts are read.
    """

    cycles: int
    decay: DecayLikelihood | None = None
    contacts: ContactTerms | None = None
    by_form: tuple[tuple[float, float], ...] = ()
    by_contacts: int = 0
    flights: NDArray[np.float64] = field(default_factory=lambda: flight_table(()))

    def __add__(self, other: CycleLikelihoods) -> CycleLikelihoods:
        return CycleLikelihoods(
            cycles=self.cycles + other.cycles,
            decay=self.decay + other.decay if self.decay and other.decay else None,
            contacts=self.contacts + other.contacts if self.contacts and other.contacts else None,
            by_form=self.by_form + other.by_form,
            by_contacts=self.by_contacts + other.by_contacts,
            flights=np.concatenate([self.flights, other.flights]),
        )

    def without_decay(self) -> CycleLikelihoods:
        """The contacts alone, with a decay that says nothing."""
        if self.decay is None:
            return self
        return replace(self, decay=self.decay.emptied(), by_contacts=self.cycles)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All fields as arrays, for a file; derivatives in single precision."""
        content: dict[str, NDArray[Any]] = {
            'cycles': np.array(self.cycles),
            'by_contacts': np.array(self.by_contacts),
            'flights': self.flights.astype(np.float32),
            'by_form': np.array(self.by_form, dtype=np.float64).reshape(-1, 2),
        }
        if self.decay is None or self.contacts is None:
            return content
        for part in fields(self.contacts):
            content[f'contacts.{part.name}'] = np.asarray(getattr(self.contacts, part.name))
        content |= _decay_arrays('decay', self.decay)
        content['frictions'] = np.array([friction for friction, _ in self.decay.rough])
        for number, (_, decay) in enumerate(self.decay.rough):
            content |= _decay_arrays(f'rough_{number}', decay)
        return content

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], where: str) -> CycleLikelihoods:
        """Likelihoods from the arrays of `arrays`.

        Parameters
        ----------
        arrays : mapping of str to ndarray
        where : str
            Source of the arrays, for the error.

        Raises
        ------
        FitError
            When an array is missing or has the wrong shape.
        """
        try:
            by_form = tuple((float(a), float(b)) for a, b in arrays['by_form'])
            cycles = int(arrays['cycles'])
            if 'decay.information' not in arrays:
                return cls(cycles=cycles, by_form=by_form)
            rough = tuple(
                (float(friction), _decay_from(arrays, f'rough_{number}'))
                for number, friction in enumerate(arrays['frictions'])
            )
            # Another version may have compared other nuisances.
            decay = _decay_from(arrays, 'decay')
            flights = arrays['flights']
            if (
                decay.gradient.shape[-1] != NUISANCE_COUNT
                or flights.shape[1:] != flight_table(()).shape[1:]
            ):
                raise FitError(where, 'was made with other nuisances', _NOT_THERE)
            none = ContactTerms.of(())
            contacts = ContactTerms(
                rebounds=int(arrays['contacts.rebounds']),
                collisions=int(arrays['contacts.collisions']),
                walls=arrays['contacts.walls'].reshape(none.walls.shape),
                beads=arrays['contacts.beads'].reshape(none.beads.shape),
                friction=arrays['contacts.friction'].reshape(none.friction.shape),
                rebound_losses=arrays['contacts.rebound_losses'],
                collision_losses=arrays['contacts.collision_losses'],
                rebound_impacts=arrays['contacts.rebound_impacts'],
                collision_impacts=arrays['contacts.collision_impacts'],
                reading_error=float(arrays['contacts.reading_error']),
            )
            return cls(
                cycles=cycles,
                decay=replace(decay, rough=rough),
                contacts=contacts,
                flights=flights,
                by_form=by_form,
                by_contacts=int(arrays['by_contacts']),
            )
        except (KeyError, ValueError, IndexError, TypeError) as error:
            raise FitError(where, 'holds no evidence of cycles', _NOT_THERE) from error


def _decay_arrays(prefix: str, decay: DecayLikelihood) -> dict[str, NDArray[Any]]:
    """Arrays of one friction; of the information, by far the largest, the upper half."""
    upper = np.triu_indices(decay.gradient.shape[-1])
    return {
        f'{prefix}.log_likelihood': decay.log_likelihood,
        f'{prefix}.start': decay.start,
        f'{prefix}.gradient': decay.gradient.astype(np.float32),
        f'{prefix}.information': decay.information[..., upper[0], upper[1]].astype(np.float32),
        f'{prefix}.deviation': decay.deviation,
        f'{prefix}.samples': np.array(decay.samples),
        f'{prefix}.decays': np.array(decay.decays),
    }


def _decay_from(arrays: Mapping[str, NDArray[Any]], prefix: str) -> DecayLikelihood:
    gradient = arrays[f'{prefix}.gradient'].astype(np.float64)
    half = arrays[f'{prefix}.information']
    upper = np.triu_indices(gradient.shape[-1])
    information = np.empty((*gradient.shape, gradient.shape[-1]))
    information[..., upper[0], upper[1]] = half
    information[..., upper[1], upper[0]] = half
    return DecayLikelihood(
        log_likelihood=arrays[f'{prefix}.log_likelihood'],
        start=arrays[f'{prefix}.start'],
        gradient=gradient,
        information=information,
        deviation=arrays[f'{prefix}.deviation'],
        samples=int(arrays[f'{prefix}.samples']),
        decays=int(arrays[f'{prefix}.decays']),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanRestitution:
    """Restitutions from many cycles together; NaN where unknown.

    Parameters
    ----------
    cycles : int
    restitution : MeasuredInterval
        Between beads: mean, standard deviation and interval of the posterior.
    wall_restitution : MeasuredInterval
        Between beads and side walls.
    restitution_lower_68, restitution_upper_68 : float
    wall_restitution_lower_68, wall_restitution_upper_68 : float
        Ends of the intervals with the probability `ONE_SIGMA`.
    tension : float
        Standard deviations by which decays, rebounds and collisions disagree.
    rebounds, collisions : int
    by_contacts : int
        Cycles that enter with their contacts alone.
    headline : Headline
        Source of both restitutions, as of a cycle.
    wall_friction : Measured
    drag : Measured, [1/s]
    restitution_exponent, wall_restitution_exponent : Interval
    restitution_exponent_lower_68, restitution_exponent_upper_68 : float
    wall_restitution_exponent_lower_68, wall_restitution_exponent_upper_68 : float
    impact_speed, wall_impact_speed : float, [m/s]
    impact_restitution, wall_impact_restitution : Interval
    speed_dependent : bool
        Whether an exponent is not 0.
    friction_unknown : bool
        Whether beads count as smooth that may rub.
    """

    cycles: int
    restitution: MeasuredInterval
    wall_restitution: MeasuredInterval = UNKNOWN_MEASURED_INTERVAL
    restitution_lower_68: float = UNKNOWN
    restitution_upper_68: float = UNKNOWN
    wall_restitution_lower_68: float = UNKNOWN
    wall_restitution_upper_68: float = UNKNOWN
    tension: float = UNKNOWN
    rebounds: int = 0
    collisions: int = 0
    by_contacts: int = 0
    headline: Headline = Headline.UNKNOWN
    wall_friction: Measured = UNKNOWN_MEASURED
    drag: Measured = UNKNOWN_MEASURED
    restitution_exponent: Interval = UNKNOWN_INTERVAL
    wall_restitution_exponent: Interval = UNKNOWN_INTERVAL
    restitution_exponent_lower_68: float = UNKNOWN
    restitution_exponent_upper_68: float = UNKNOWN
    wall_restitution_exponent_lower_68: float = UNKNOWN
    wall_restitution_exponent_upper_68: float = UNKNOWN
    impact_speed: float = UNKNOWN
    wall_impact_speed: float = UNKNOWN
    impact_restitution: Interval = UNKNOWN_INTERVAL
    wall_impact_restitution: Interval = UNKNOWN_INTERVAL
    speed_dependent: bool = False
    friction_unknown: bool = False

    @property
    def quality(self) -> Quality:
        """Flags of a cycle that hold for all of them together."""
        flags = Quality(0)
        if self.speed_dependent:
            flags |= Quality.SPEED_DEPENDENT
        if self.friction_unknown:
            flags |= Quality.FRICTION_UNKNOWN
        return flags
