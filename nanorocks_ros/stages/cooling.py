"""From mean speeds to the coefficient of restitution of the cycle, updated as it cools."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.physics.haff_fit import HaffFit, fit_haff
from nanorocks_ros.physics.paper import paper_restitution_of_decay
from nanorocks_ros.records import CorEstimate, CorRelation, CorStatus, SpeedEstimate
from nanorocks_ros.stages.shaking import NS

if TYPE_CHECKING:
    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Tray


# Stamps that came over the wire are float32 seconds: 0.1 ms half an hour into a recording.
_STAMP_ROUNDING_NS = 1_000_000


class HaffFitter:
    """Fits Haff's law to the speeds of each cycle and reads a restitution from the decay.

    While a cycle cools it publishes an estimate every `update_interval`; the last one of the
    cycle, at the end of the cooling window or at the next shaking event, is final.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.cooling
        if self._settings.delay >= self._settings.duration:
            raise ConfigurationError(
                'cooling.delay',
                f'{self._settings.delay:g} s is not before cooling.duration, '
                f'{self._settings.duration:g} s',
                'choose a window that holds speeds',
            )
        self._tray = tray
        self._restart()

    def _restart(self) -> None:
        self._last_stamp_ns: int | None = None
        self._samples: list[SpeedEstimate] = []
        self._cycle = 0
        self._finished = True
        self._last_update_ns: int | None = None
        self._finals: list[tuple[float, float]] = []

    def push(self, speed: SpeedEstimate) -> tuple[CorEstimate, ...]:
        """Take the next speed; empty between two updates and before the first shake.

        A stamp that goes back starts all afresh, running mean included.
        """
        if self._last_stamp_ns is not None and speed.stamp_ns <= self._last_stamp_ns:
            self._restart()
        self._last_stamp_ns = speed.stamp_ns
        found: tuple[CorEstimate, ...] = ()
        if speed.cycle != self._cycle:
            found = self.flush()
            self._cycle, self._samples, self._finished = speed.cycle, [], False
            self._last_update_ns = None
        if speed.cycle_start_ns is None or self._finished:
            return found
        age = (speed.stamp_ns - speed.cycle_start_ns) / NS
        if age > self._settings.duration:
            return (*found, *self.flush())
        if age >= self._settings.delay and _usable(speed):
            self._samples.append(speed)
            if self._update_due(speed.stamp_ns):
                found = (*found, *self._estimate(CorStatus.COOLING))
        return found

    def flush(self) -> tuple[CorEstimate, ...]:
        """End the cycle: its final estimate, if it has samples and had none yet."""
        if self._finished:
            return ()
        self._finished = True
        return self._estimate(CorStatus.FINAL)

    def _update_due(self, stamp_ns: int) -> bool:
        if len(self._samples) < self._settings.fewest_samples:
            return False
        last = self._last_update_ns
        interval = self._settings.update_interval * NS - _STAMP_ROUNDING_NS
        if last is not None and stamp_ns - last < interval:
            return False
        self._last_update_ns = stamp_ns
        return True

    def _estimate(self, status: CorStatus) -> tuple[CorEstimate, ...]:
        if len(self._samples) < self._settings.fewest_samples:
            return ()
        last = self._samples[-1]
        start_ns = last.cycle_start_ns or 0
        try:
            fit = fit_haff(
                np.array([(one.stamp_ns - start_ns) / NS for one in self._samples]),
                np.array([one.mean_projected_speed for one in self._samples]),
                np.array([one.mean_projected_speed_error for one in self._samples]),
                self._tray.count,
            )
        except FitError:
            # Nothing is known of the restitution then, and that is what is published.
            return (
                CorEstimate(
                    stamp_ns=last.stamp_ns,
                    tray=last.tray,
                    cycle=last.cycle,
                    status=CorStatus.NO_DECAY,
                    relation=CorRelation.PAPER,
                    restitution_lower=0.0,
                    restitution_upper=1.0,
                    samples=len(self._samples),
                ),
            )
        return (self._restitution(last, status, fit),)

    def _restitution(self, last: SpeedEstimate, status: CorStatus, fit: HaffFit) -> CorEstimate:
        quantile = float(
            special.stdtrit(fit.degrees_of_freedom, 0.5 + 0.5 * self._settings.probability)
        )
        spread = math.exp(quantile * fit.log_decay_rate_error)
        rates = (fit.decay_rate, fit.decay_rate * spread, fit.decay_rate / spread)
        value, lower, upper = (
            paper_restitution_of_decay(rate, self._tray.diameter, self._tray.number_density)
            for rate in rates
        )
        if status is CorStatus.FINAL:
            self._finals.append((value, (upper - lower) / (2.0 * quantile)))
        mean, mean_error = self._running_mean()
        return CorEstimate(
            stamp_ns=last.stamp_ns,
            tray=last.tray,
            cycle=last.cycle,
            status=status,
            relation=CorRelation.PAPER,
            restitution=value,
            restitution_lower=lower,
            restitution_upper=upper,
            initial_speed=fit.initial_speed,
            initial_speed_error=fit.initial_speed_error,
            haff_time=fit.haff_time,
            haff_time_error=fit.haff_time_error,
            reduced_chi_square=fit.reduced_chi_square,
            samples=fit.samples,
            mean_restitution=mean,
            mean_restitution_error=mean_error,
        )

    def _running_mean(self) -> tuple[float, float]:
        if not self._finals:
            return float('nan'), float('nan')
        values = np.array([value for value, _ in self._finals])
        if values.size == 1:
            return float(values[0]), self._finals[0][1]
        return float(values.mean()), float(values.std(ddof=1) / math.sqrt(values.size))


def _usable(speed: SpeedEstimate) -> bool:
    value, error = speed.mean_projected_speed, speed.mean_projected_speed_error
    return math.isfinite(value) and math.isfinite(error) and value > 0.0 and error > 0.0
