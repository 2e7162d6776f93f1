"""From speeds and contacts to the coefficients of restitution of each cycle."""

from __future__ import annotations

import math
from functools import partial, reduce
from operator import or_
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.cooling_age import cooling_age
from nanorocks_ros.records import (
    NS,
    UNKNOWN,
    ContactOrFlight,
    CorEstimate,
    CorStatus,
    Measured,
    Merge,
    Quality,
    Rebound,
    SpeedEstimate,
    field_names,
)
from nanorocks_ros.stages.contacts.cycle_contacts import CycleContacts
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS
from nanorocks_ros.stages.restitution.cycle_restitution import UNDETERMINED, CycleRestitution
from nanorocks_ros.stages.restitution.cycle_speeds import certain_speeds, warnings_of
from nanorocks_ros.stages.restitution.cycle_sticking import CycleSticking
from nanorocks_ros.stages.restitution.decay_library_method import DecayLibraryMethod
from nanorocks_ros.stages.restitution.paper_method import PaperMethod
from nanorocks_ros.stages.restitution.restitution_method import Decay, RestitutionMethod
from nanorocks_ros.stages.restitution.species_decays import species_decays
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from collections.abc import Callable

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods, MeanRestitution
    from nanorocks_ros.settings import PipelineSettings


# Fields of a `CycleRestitution` that are published under the same name.
_PUBLISHED = sorted(set(field_names(CycleRestitution)) & set(field_names(CorEstimate)))
# Stamps that came over the wire may be rounded.
_STAMP_ROUNDING_NS = 1_000_000
# The first speed may come that much later for other reasons than a tray that oscillates.
_LATE_NS = 500_000_000
# Standard deviations by which decay, rebounds and collisions may disagree without a flag.
_LARGEST_TENSION = 3.0
RestitutionInput = SpeedEstimate | ContactOrFlight | Merge
"""The records from which restitutions are estimated."""


class RestitutionEstimator(RestartingStage[RestitutionInput, CorEstimate]):
    """Estimates restitutions from the speeds and contacts of each cycle, and of all of them.

    While a cycle cools there is an estimate every `update_interval`. The last one of the cycle,
    at the end of the cooling window or at the next shaking event, is final. A speed whose stamp
    goes back ends the cycle and starts all afresh, running mean included.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Raises
    ------
    ConfigurationError
        For a window that is not valid, or a tray without a library of simulated decays.
    """

    clock = SpeedEstimate

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._tray = tray
        self._take(settings)
        self._grains = any(species.properties.shape == 'grain' for species in tray.species)
        self._contacts = CycleContacts(self._settings, among_grains=self._grains)
        self._sticking = CycleSticking(settings, tray)
        self.reset()

    def _take(self, settings: PipelineSettings) -> None:
        self._settings = settings.cooling
        method = DecayLibraryMethod if self._settings.relation == 'library' else PaperMethod
        self._make_method: Callable[[], RestitutionMethod] = partial(method, settings, self._tray)

    def adopt(self, settings: PipelineSettings) -> None:
        """Estimate with other settings from now on, with all that is known of the running cycle.

        The mean of earlier cycles, which were estimated with the settings before, starts afresh.

        Parameters
        ----------
        settings : PipelineSettings
            Its `cooling.rebounds` and `cooling.collisions` must be as before.

        Raises
        ------
        ConfigurationError
            As of the constructor.
        """
        self._take(settings)
        self._method = self._make_method()
        self._sticking.adopt(settings)

    def _restart(self, stamp_ns: int | None = None) -> None:
        if stamp_ns is not None:
            self._contacts.restart(stamp_ns)
        self._samples: list[SpeedEstimate] = []
        self._cycle = 0
        self._finished = True
        self._sticking.next_cycle()
        self._early_merges: list[Merge] = []
        self._flags = Quality(0)
        self._last_update_ns: int | None = None
        self._method = self._make_method()

    @property
    def evidence(self) -> CycleLikelihoods | None:
        """Evidence of the cycles finished since time last went back; None without any."""
        return self._method.evidence

    def mean_of(self, evidence: CycleLikelihoods) -> MeanRestitution:
        """Mean restitution of several cycles, also of other recordings of the tray.

        Raises
        ------
        FitError
            When they were estimated by another method.
        """
        return self._method.mean_of(evidence)

    def _process(self, record: RestitutionInput) -> tuple[CorEstimate, ...]:
        if isinstance(record, SpeedEstimate):
            return self._push_speed(record)
        if isinstance(record, Merge):
            self._push_merge(record)
        else:
            self._contacts.push(record)
        return ()

    def _push_merge(self, merge: Merge) -> None:
        """End the decay where beads began to stick, which is known some time later."""
        if not self._settings.until_merge:
            return
        if merge.cycle > self._cycle:
            # Known before the first speed of its cycle.
            self._early_merges.append(merge)
        elif merge.cycle == self._cycle and not self._finished:
            self._sticking.push_merge(merge)
            self._contacts.merge(merge)

    def _push_speed(self, speed: SpeedEstimate) -> tuple[CorEstimate, ...]:
        estimates: tuple[CorEstimate, ...] = ()
        if speed.cycle != self._cycle:
            estimates = self._end_cycle()
            self._cycle, self._samples, self._finished = speed.cycle, [], False
            self._last_update_ns = None
            self._flags = Quality(0)
            self._contacts.next_cycle()
            self._sticking.next_cycle()
            early, self._early_merges = self._early_merges, []
            for merge in early:
                self._push_merge(merge)
        if speed.cycle_start_ns is None or self._finished:
            return estimates
        age = (speed.stamp_ns - speed.cycle_start_ns) / NS
        if age > 0.0 and _usable(speed):
            self._sticking.push_speed(speed)
        if not self._samples and self._driven(speed):
            # A tray that oscillates drives the gas, but a single contact is used as well.
            self._count_contacts(speed)
            return estimates
        first = self._samples[0] if self._samples else speed
        if speed.stamp_ns - self._start_ns(first) > self._settings.duration * NS:
            return (*estimates, *self._end_cycle())
        if age > 0.0 and age >= self._settings.delay and _usable(speed):
            self._samples.append(speed)
            self._count_contacts(speed)
            if self._update_due(speed.stamp_ns):
                estimates = (*estimates, *self._estimate(CorStatus.COOLING))
        return estimates

    def _count_contacts(self, speed: SpeedEstimate, later_ns: int = 0) -> None:
        """Count the contacts since the shaking was over that are all known after a speed.

        Parameters
        ----------
        speed : SpeedEstimate
        later_ns : int, [ns]
            Time from the speed up to which contacts have come in.
        """
        shake_ns = speed.cycle_start_ns or 0
        first_ns = shake_ns + round(self._settings.delay * NS)
        self._contacts.count(first_ns, speed.stamp_ns + later_ns)

    def _driven(self, speed: SpeedEstimate) -> bool:
        """Whether the tray still oscillates too fast for the gas in it to cool freely."""
        calm = self._settings.max_tray_to_bead_speed * speed.mean_projected_speed.value
        return speed.tray_speed > calm

    def _start_ns(self, first: SpeedEstimate) -> int:
        """When the gas began to cool freely, by the first speed used."""
        shake_ns = first.cycle_start_ns or 0
        # A tray that went on oscillating drove the gas until shortly before the window.
        late_ns = first.stamp_ns - shake_ns - round(self._settings.delay * NS)
        return shake_ns + (late_ns if late_ns > _LATE_NS else 0)

    def flag_cycle(self, quality: Quality) -> None:
        """Add flags to the estimates of the current cycle, beside those of its speeds."""
        self._flags |= quality

    def flush(self) -> tuple[CorEstimate, ...]:
        """End the recording: the final estimate, with all contacts up to the last speed."""
        if self._samples and not self._finished:
            self._count_contacts(self._samples[-1], later_ns=KNOWN_AFTER_NS[Rebound])
        return self._end_cycle()

    def _interrupted(self) -> tuple[CorEstimate, ...]:
        return self._end_cycle()

    def _end_cycle(self) -> tuple[CorEstimate, ...]:
        """The final estimate of the cycle, if it has samples and had none yet."""
        if self._finished:
            return ()
        self._finished = True
        return self._estimate(CorStatus.FINAL)

    def _update_due(self, stamp_ns: int) -> bool:
        if len(self._samples) < self._settings.min_samples:
            return False
        last = self._last_update_ns
        interval = self._settings.update_interval * NS - _STAMP_ROUNDING_NS
        if last is not None and stamp_ns - last < interval:
            return False
        self._last_update_ns = stamp_ns
        return True

    def _undetermined(self) -> tuple[CorEstimate, ...]:
        """The estimate of a cycle with too few speeds and no contacts: undetermined."""
        stamp_ns = self._samples[-1].stamp_ns if self._samples else self._last_ns
        if stamp_ns is None or not (self._samples or self._sticking.first_merge_ns is not None):
            return ()
        return (
            CorEstimate(
                stamp_ns=stamp_ns,
                tray=self._tray.number,
                cycle=self._cycle,
                status=CorStatus.UNDETERMINED,
                relation=self._method.relation,
                restitution=UNDETERMINED,
                samples=len(self._before_merge()),
            ),
        )

    def _before_merge(self) -> list[SpeedEstimate]:
        """The speeds of the cycle up to its first merge."""
        first_ns = self._sticking.first_merge_ns
        if first_ns is None:
            return self._samples
        return [sample for sample in self._samples if sample.stamp_ns < first_ns]

    def _estimate(self, status: CorStatus) -> tuple[CorEstimate, ...]:
        first_ns, samples = self._sticking.first_merge_ns, self._before_merge()
        if len(samples) < self._settings.min_samples:
            samples = []
        if not self._samples or (not samples and first_ns is None):
            return self._undetermined() if status is CorStatus.FINAL else ()
        last = self._samples[-1]
        shake_ns, start_ns = last.cycle_start_ns or 0, self._start_ns(self._samples[0])
        window = [(sample.stamp_ns - shake_ns) / NS for sample in samples] or [UNKNOWN]
        samples = certain_speeds(samples)
        decay = self._decay(samples, start_ns) if samples else None
        quality = self._flags | warnings_of(samples or self._samples, self._tray)
        self._contacts.stick(self._sticking.speed_weights(shake_ns))
        outcome, result = self._cycle_restitution(decay, quality, status)
        initial_speeds: tuple[Measured, ...] = ()
        haff_times: tuple[Measured, ...] = ()
        if status is CorStatus.FINAL and decay is not None:
            few = self._settings.min_samples
            initial_speeds, haff_times = species_decays(self._tray, decay.time, samples, few)
        return (
            CorEstimate(
                stamp_ns=last.stamp_ns,
                tray=last.tray,
                cycle=last.cycle,
                status=outcome,
                relation=self._method.relation,
                samples=len(samples),
                quality=quality | self._quality_of(result),
                window_start=window[0],
                window_end=window[-1],
                cooling_start=(start_ns - shake_ns) / NS,
                onset=UNKNOWN if first_ns is None else (first_ns - shake_ns) / NS,
                species_initial_speeds=initial_speeds,
                species_haff_times=haff_times,
                **{name: getattr(result, name) for name in _PUBLISHED},
            ),
        )

    def _quality_of(self, result: CycleRestitution) -> Quality:
        """What a restitution and the merges say against the decay."""
        flags = {
            Quality.INCONSISTENT: result.tension > _LARGEST_TENSION,
            Quality.ACCELERATED: result.accelerated,
            Quality.SPEED_DEPENDENT: result.speed_dependent,
            Quality.FRICTION_UNKNOWN: result.friction_unknown,
            Quality.STICKING: self._sticking.first_merge_ns is not None,
        }
        return reduce(or_, [flag for flag, is_set in flags.items() if is_set], Quality(0))

    def _decay(self, samples: list[SpeedEstimate], start_ns: int) -> Decay:
        """The speeds of the cycle, with times since the gas began to cool freely."""
        shake_ns = samples[0].cycle_start_ns or 0
        return Decay(
            time=np.array([(sample.stamp_ns - start_ns) / NS for sample in samples]),
            speed=np.array([sample.mean_projected_speed.value for sample in samples]),
            error=np.array([sample.mean_projected_speed.error for sample in samples]),
            of_grains=self._grains,
            age=cooling_age((start_ns - shake_ns) / NS),
        )

    def _cycle_restitution(
        self, decay: Decay | None, quality: Quality, status: CorStatus
    ) -> tuple[CorStatus, CycleRestitution]:
        """The restitution of the cycle and the status of the estimate."""
        if quality & Quality.WRONG_SCALE:
            # Errors of speeds and positions are unknown.
            return CorStatus.UNDETERMINED, CycleRestitution()
        final = status is CorStatus.FINAL
        try:
            result = self._method.estimate(decay, self._contacts, final=final)
        except FitError:
            if self._sticking.first_merge_ns is not None and decay is not None:
                # Before the first merge there was no time to slow down.
                return self._cycle_restitution(None, quality, status)
            # The restitution is published as unknown.
            return CorStatus.NO_DECAY, CycleRestitution()
        return status if result.determined else CorStatus.UNDETERMINED, result


def _usable(speed: SpeedEstimate) -> bool:
    value, error = speed.mean_projected_speed.value, speed.mean_projected_speed.error
    return math.isfinite(value) and math.isfinite(error) and value > 0.0 and error > 0.0
