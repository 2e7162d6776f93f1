"""The method that compares a decay with simulated decays, and adds what contacts say.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.contacts.rebound_reading import rebound_reading
from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods, MeanRestitution
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.decay.friction_weights import friction_weights, is_friction_told
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.inference.flights.flight_losses import flight_losses
from nanorocks_ros.inference.posterior import check_walls
from nanorocks_ros.inference.restitution_sources import restitution_sources
from nanorocks_ros.inference.speed_dependence import RunningDependence, speed_dependence
from nanorocks_ros.records import (
    UNKNOWN_MEASURED,
    CorRelation,
    Headline,
    Measured,
    MeasuredInterval,
)
from nanorocks_ros.stages.flights.relative_drag import mean_relative_drag
from nanorocks_ros.stages.restitution.cycle_restitution import CycleRestitution
from nanorocks_ros.stages.restitution.haff_values import (
    haff_time,
    initial_speed,
    paper_restitution,
)
from nanorocks_ros.stages.restitution.restitution_method import Decay
from nanorocks_ros.stages.restitution.source_fields import (
    NARROW,
    by_source,
    determined,
    ends_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.grid_likelihood import DecayLikelihood
    from nanorocks_ros.inference.flights.flight_losses import FlightLosses
    from nanorocks_ros.inference.restitution_sources import RestitutionSources
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.stages.restitution.restitution_method import Contacts

# Largest work of an acceleration on a bead that crosses the tray, over its mean square speed, with
# which a decay still counts: speeds then change by a tenth.
_MAX_WORK = 0.1
# For the shape of a likelihood that says nothing.
_ANY_TIMES = np.linspace(1.0, 10.0, 10)
_ANY_DECAY = Decay(
    time=_ANY_TIMES, speed=5e-3 / (1.0 + _ANY_TIMES), error=1e-4 / (1.0 + _ANY_TIMES)
)


class DecayLibraryMethod:
    """Compares the measured decay with simulated decays of the tray.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Raises
    ------
    ConfigurationError
        When there is no library of such a tray, or the prior of the walls is not valid.
    """

    relation = CorRelation.LIBRARY

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._tray = tray
        prior = settings.prior
        library = library_of(tray, settings.cooling.decay_library)
        self._tables = tables_of(library, tray, prior)
        # An error of the library itself acts as an error of the scale.
        scale = math.hypot(prior.scale_error, library.misfit)
        self._camera = {
            False: (scale, prior.speed_bias),
            True: (math.hypot(scale, prior.grain_scale_error), prior.grain_speed_bias),
        }
        self._prior = prior
        self._drag_prior = Measured(prior.drag, prior.drag_error)
        self._reading_of = partial(
            rebound_reading, sides=tray.dimensions[:2], readout=prior.readout
        )
        self._relative_drag = mean_relative_drag(tray)
        check_walls((prior.min_wall_restitution, prior.max_wall_restitution))
        self._ends = ends_of(settings.cooling.probability)
        self._probability = settings.cooling.probability
        self._include_inconsistent = settings.cooling.include_inconsistent
        self._dependence = RunningDependence()
        self.evidence: CycleLikelihoods | None = None
        self._means_so_far = UNKNOWN_MEASURED, UNKNOWN_MEASURED

    def estimate(
        self, decay: Decay | None, contacts: Contacts, *, final: bool
    ) -> CycleRestitution:
        """Restitution of a cycle.

        Raises
        ------
        FitError
            When the speeds do not fall.
        """
        if decay is not None and not _falls(decay):
            raise FitError('cooling', 'the speeds do not fall', 'give a window in which they do')
        flights = contacts.flights
        losses = flight_losses(flights, self._drag_prior)
        terms = contacts.terms(losses.slowing.drag.value, self._reading_of)
        friction = friction_weights(self._prior, terms)
        highest = math.inf if final else friction.highest if friction else 0.0
        likelihood = self._likelihood(decay, losses, highest)
        integrated = likelihood.integrated(friction)
        accelerated = losses.is_accelerated and decay is not None and self._drives(losses, decay)
        dependence = self._dependence.of(terms, losses, self._prior, final=final)
        sources = restitution_sources(
            self._tables,
            integrated,
            terms,
            self._prior,
            decay_counts=decay is not None and not accelerated,
            losses=losses,
            dependence=dependence,
        )
        result = replace(
            self._of_decay(decay, likelihood, integrated, final=final),
            **by_source(sources, self._ends, has_decay=decay is not None),
            rebounds=terms.rebounds,
            collisions=terms.collisions,
            body_rebounds=contacts.body_rebounds,
            drag=sources.drag if losses.flights else UNKNOWN_MEASURED,
            acceleration=losses.magnitude(self._probability),
            accelerated=accelerated,
            friction_unknown=self._is_friction_unknown(sources),
            **dependence.fields(self._ends, NARROW),
        )
        result = determined(result, sources, self._ends)
        trusted = self._include_inconsistent or sources.headline is not Headline.CONTACTS
        trusted = trusted and not (accelerated or dependence.is_seen)
        own = CycleLikelihoods(cycles=1, decay=likelihood, contacts=terms, flights=flights)
        mean, wall_mean = self._means(own, final=final, trusted=trusted)
        return replace(result, mean_restitution=mean, mean_wall_restitution=wall_mean)

    def _likelihood(
        self, decay: Decay | None, losses: FlightLosses, highest: float
    ) -> DecayLikelihood:
        """Likelihood of a decay up to a friction; one that says nothing without a decay."""
        known = decay or _ANY_DECAY
        likelihood = decay_likelihood(
            self._tables,
            known.age.value + known.time,
            known.speed,
            known.error,
            self._camera[known.of_grains],
            self._drag_of_gas(losses.slowing.drag),
            highest,
            known.age.error,
        )
        return likelihood.emptied() if decay is None else likelihood

    def _of_decay(
        self,
        decay: Decay | None,
        likelihood: DecayLikelihood,
        integrated: NDArray[np.float64],
        *,
        final: bool,
    ) -> CycleRestitution:
        """What the decay alone tells, but for the restitutions."""
        if decay is None:
            return CycleRestitution()
        best = int(np.argmax(integrated))
        return replace(
            self._speeds(decay, final=final),
            reduced_chi_square=likelihood.deviation_at(best) / max(likelihood.samples - 1, 1),
        )

    def _drag_of_gas(self, drag: Measured) -> Measured:
        """Drag of the mean speed of all species, from that of the first."""
        return Measured(self._relative_drag * drag.value, self._relative_drag * drag.error)

    def _is_friction_unknown(self, sources: RestitutionSources) -> bool:
        """Whether a decay counts, of beads that count as smooth and may rub."""
        by_decay = sources.headline is not Headline.CONTACTS
        return by_decay and not is_friction_told(self._prior, sources.wall_friction)

    def _drives(self, losses: FlightLosses, decay: Decay) -> bool:
        """Whether beads that fall across the tray gain more than a small part of their energy."""
        work = float(np.hypot(*losses.acceleration)) * max(self._tray.dimensions[:2])
        return work > _MAX_WORK * float(np.mean(decay.speed**2))

    def _means(
        self, own: CycleLikelihoods, *, final: bool, trusted: bool
    ) -> tuple[Measured, Measured]:
        """Mean restitutions of beads and of walls, of all finished cycles.

        A cycle whose decay is not trusted counts with its contacts.
        """
        if not final:
            return self._means_so_far
        own = own if trusted else own.without_decay()
        self.evidence = self.evidence + own if self.evidence else own
        mean = self.mean_of(self.evidence)
        self._means_so_far = mean.restitution.measured, mean.wall_restitution.measured
        return self._means_so_far

    def mean_of(self, evidence: CycleLikelihoods) -> MeanRestitution:
        """Mean restitution of several cycles, whose systematic errors are the same.

        Raises
        ------
        FitError
            When the cycles were not compared with a library, or with one of another grid.
        """
        decay, contacts = evidence.decay, evidence.contacts
        if (
            decay is None
            or contacts is None
            or decay.deviation.shape[-1] != self._tables.mean.shape[0]
            or len(decay.rough) != len(self._tables.rough)
        ):
            raise FitError(
                f'tray {self._tray.number}',
                'cycles were not read by this library of decays',
                'analyse their recordings again',
            )
        decays = evidence.cycles - evidence.by_contacts
        losses = flight_losses(evidence.flights, self._drag_prior)
        friction = friction_weights(self._prior, contacts)
        dependence = speed_dependence(contacts, losses, self._prior)
        sources = restitution_sources(
            self._tables,
            decay.integrated(friction),
            contacts,
            self._prior,
            decay_counts=decays > 0,
            losses=losses,
            dependence=dependence,
        )
        intervals, means = sources.intervals(self._ends), sources.means
        restitution, wall_restitution = (
            MeasuredInterval(mean.value, mean.error, interval.lower, interval.upper)
            for mean, interval in zip(means, intervals, strict=True)
        )
        narrow, narrow_walls = sources.intervals(NARROW)
        return MeanRestitution(
            cycles=evidence.cycles,
            by_contacts=evidence.by_contacts,
            restitution=restitution,
            restitution_lower_68=narrow.lower,
            restitution_upper_68=narrow.upper,
            wall_restitution=wall_restitution,
            wall_restitution_lower_68=narrow_walls.lower,
            wall_restitution_upper_68=narrow_walls.upper,
            tension=sources.joint.tension,
            rebounds=contacts.rebounds,
            collisions=contacts.collisions,
            headline=sources.headline,
            wall_friction=sources.wall_friction,
            drag=sources.drag if losses.flights else UNKNOWN_MEASURED,
            friction_unknown=self._is_friction_unknown(sources),
            **dependence.fields(self._ends, NARROW),
        )

    def _speeds(self, decay: Decay, *, final: bool) -> CycleRestitution:
        """Initial speed and Haff time, with errors once the cycle is over."""
        if final:
            with suppress(FitError):
                # Nearly elastic beads may have no Haff time, but have a restitution.
                fit = fit_haff(decay.time, decay.speed, decay.error, self._tray.count)
                return CycleRestitution(
                    initial_speed=initial_speed(fit),
                    haff_time=haff_time(fit),
                    paper_restitution=paper_restitution(fit.decay_rate, self._tray),
                )
        # A straight line through 1/v, as Haff's law is one; a proper fit takes too long.
        slope, offset = (float(number) for number in np.polyfit(decay.time, 1.0 / decay.speed, 1))
        falling = slope > 0.0 and offset > 0.0
        return CycleRestitution(
            initial_speed=Measured(1.0 / offset if falling else math.nan),
            haff_time=Measured(offset / slope if falling else math.nan),
            paper_restitution=paper_restitution(max(slope, 0.0), self._tray),
        )


def _falls(decay: Decay) -> bool:
    return bool((decay.time - decay.time.mean()) @ np.log(decay.speed) < 0.0)
