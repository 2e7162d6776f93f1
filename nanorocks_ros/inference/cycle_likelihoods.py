"""Likelihoods of both restitutions from finished cycles, which can be added and saved.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_likelihood import DecayLikelihood
from nanorocks_ros.records import (
    UNKNOWN,
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Headline,
    Measured,
    MeasuredInterval,
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
    """

    cycles: int
    decay: DecayLikelihood | None = None
    contacts: ContactTerms | None = None
    by_form: tuple[tuple[float, float], ...] = ()
    by_contacts: int = 0

    def __add__(self, other: CycleLikelihoods) -> CycleLikelihoods:
        return CycleLikelihoods(
            cycles=self.cycles + other.cycles,
            decay=self.decay + other.decay if self.decay and other.decay else None,
            contacts=self.contacts + other.contacts if self.contacts and other.contacts else None,
            by_form=self.by_form + other.by_form,
            by_contacts=self.by_contacts + other.by_contacts,
        )

    def without_decay(self) -> CycleLikelihoods:
        """The contacts alone, with a decay that says nothing."""
        if self.decay is None:
            return self
        nothing = {
            field.name: np.zeros_like(getattr(self.decay, field.name))
            for field in fields(self.decay)
            if field.name != 'samples'
        }
        decay = replace(self.decay, **nothing, samples=0)
        return replace(self, decay=decay, by_contacts=self.cycles)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All fields as arrays, for a file; derivatives in single precision."""
        content: dict[str, NDArray[Any]] = {
            'cycles': np.array(self.cycles),
            'by_contacts': np.array(self.by_contacts),
            'by_form': np.array(self.by_form, dtype=np.float64).reshape(-1, 2),
        }
        if self.decay is None or self.contacts is None:
            return content
        upper = np.triu_indices(self.decay.gradient.shape[-1])
        for prefix, part in (('decay', self.decay), ('contacts', self.contacts)):
            for field in fields(part):
                content[f'{prefix}.{field.name}'] = np.asarray(getattr(part, field.name))
        # By far the largest array, and symmetric: the upper half is enough.
        content['decay.information'] = self.decay.information[..., upper[0], upper[1]].astype(
            np.float32
        )
        content['decay.gradient'] = self.decay.gradient.astype(np.float32)
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
            gradient = arrays['decay.gradient'].astype(np.float64)
            upper = np.triu_indices(gradient.shape[-1])
            information = np.empty((*gradient.shape, gradient.shape[-1]))
            information[..., upper[0], upper[1]] = arrays['decay.information']
            information[..., upper[1], upper[0]] = arrays['decay.information']
            return cls(
                cycles=cycles,
                decay=DecayLikelihood(
                    log_likelihood=arrays['decay.log_likelihood'],
                    gradient=gradient,
                    information=information,
                    deviation=arrays['decay.deviation'],
                    samples=int(arrays['decay.samples']),
                ),
                contacts=ContactTerms(
                    rebounds=int(arrays['contacts.rebounds']),
                    collisions=int(arrays['contacts.collisions']),
                    walls=arrays['contacts.walls'],
                    beads=arrays['contacts.beads'],
                    friction=arrays['contacts.friction'],
                ),
                by_form=by_form,
                by_contacts=int(arrays['by_contacts']),
            )
        except (KeyError, ValueError, IndexError, TypeError) as error:
            raise FitError(where, 'holds no evidence of cycles', _NOT_THERE) from error


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
    tension : float
        Standard deviations by which decays, rebounds and collisions disagree.
    rebounds, collisions : int
    by_contacts : int
        Cycles that enter with their contacts alone.
    headline : Headline
        Source of both restitutions, as of a cycle.
    wall_friction : Measured
    """

    cycles: int
    restitution: MeasuredInterval
    wall_restitution: MeasuredInterval = UNKNOWN_MEASURED_INTERVAL
    tension: float = UNKNOWN
    rebounds: int = 0
    collisions: int = 0
    by_contacts: int = 0
    headline: Headline = Headline.UNKNOWN
    wall_friction: Measured = UNKNOWN_MEASURED
