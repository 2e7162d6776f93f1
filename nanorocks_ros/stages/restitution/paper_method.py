"""The method of the paper: its closed form on a fit of Haff's law.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods, MeanRestitution
from nanorocks_ros.inference.decay.haff_fit import HaffFit, fit_haff
from nanorocks_ros.records import (
    ONE_SIGMA,
    UNKNOWN_MEASURED,
    CorRelation,
    Headline,
    Interval,
    MeasuredInterval,
)
from nanorocks_ros.stages.restitution.cycle_restitution import CycleRestitution
from nanorocks_ros.stages.restitution.haff_values import (
    haff_time,
    initial_speed,
    paper_restitution,
)

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.stages.restitution.restitution_method import Contacts, Decay


class PaperMethod:
    """The closed form of [B19] on a fit of Haff's law.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    relation = CorRelation.PAPER

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._probability = settings.cooling.probability
        self._tray = tray
        self.evidence: CycleLikelihoods | None = None

    def estimate(
        self, decay: Decay | None, contacts: Contacts, *, final: bool
    ) -> CycleRestitution:
        """Restitution of a cycle; the method of the paper does not use contacts.

        Raises
        ------
        FitError
            When the speeds do not fall.
        """
        del contacts
        if decay is None:
            return CycleRestitution()
        fit = fit_haff(decay.time, decay.speed, decay.error, self._tray.count)
        quantile, interval = _paper_interval(fit, self._tray, self._probability)
        _, narrow = _paper_interval(fit, self._tray, ONE_SIGMA)
        value, lower, upper = interval.value, interval.lower, interval.upper
        if final:
            own = CycleLikelihoods(
                cycles=1, by_form=((value, (upper - lower) / (2.0 * quantile)),)
            )
            self.evidence = self.evidence + own if self.evidence else own
        return CycleRestitution(
            determined=True,
            headline=Headline.DECAY,
            restitution=interval,
            restitution_lower_68=narrow.lower,
            restitution_upper_68=narrow.upper,
            paper_restitution=value,
            reduced_chi_square=fit.reduced_chi_square,
            mean_restitution=(
                self.mean_of(self.evidence).restitution.measured
                if self.evidence
                else UNKNOWN_MEASURED
            ),
            initial_speed=initial_speed(fit),
            haff_time=haff_time(fit),
        )

    def mean_of(self, evidence: CycleLikelihoods) -> MeanRestitution:
        """Mean and standard error by the scatter of the cycles; of one, its own error."""
        values, errors = np.array(evidence.by_form).T
        mean, error, freedom = float(values.mean()), float(errors[0]), math.inf
        if values.size > 1:
            error = float(values.std(ddof=1) / math.sqrt(values.size))
            freedom = values.size - 1.0
        reach = error * float(special.stdtrit(freedom, 0.5 + 0.5 * self._probability))
        return MeanRestitution(
            cycles=evidence.cycles,
            restitution=MeasuredInterval(mean, error, mean - reach, mean + reach),
        )


def _paper_interval(fit: HaffFit, tray: Tray, probability: float) -> tuple[float, Interval]:
    """Quantile of Student's t, and the restitution by the closed form with its interval."""
    quantile = float(special.stdtrit(fit.degrees_of_freedom, 0.5 + 0.5 * probability))
    spread = math.exp(quantile * fit.log_decay_rate_error)
    rates = fit.decay_rate, fit.decay_rate * spread, fit.decay_rate / spread
    return quantile, Interval(*(paper_restitution(rate, tray) for rate in rates))
