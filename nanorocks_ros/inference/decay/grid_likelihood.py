"""Likelihood of decays on a grid of restitutions: sums of cycles, integrals over nuisances.

Tested by ``test/inference/decay/test_decay_likelihood.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.numerics.small_cholesky import integrate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.friction_weights import FrictionWeights

MOST_CYCLES = 30.0
"""Many decays say at most what so many would: errors of the library, of its covariance and of the
linear nuisances are common to all, and do not average out. Decays of 180 simulated cycles read the
beads 0.02 to 0.06 off with a stated error of 0.002 to 0.009."""
SCALES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
"""Where a badly known scale is sampled, in its standard deviations; linear within half of one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayLikelihood:
    """Likelihood of decays on the grid; those of several decays add up.

    If the error of the scale is large, every array has one more axis in front: one likelihood for
    each sampled scale.

    Parameters
    ----------
    log_likelihood : ndarray (n_places,)
        At the expected nuisances and the best amplitude, with the prior of that.
    start : ndarray (n_places,)
        What the integral over the amplitude adds to it.
    gradient : ndarray (n_places, n_z)
        Its derivative by the nuisances, in units of their standard deviations.
    information : ndarray (n_places, n_z, n_z)
        Minus its second derivative.
    deviation : ndarray (n_places,)
        Sum of the squares of the whitened residuals.
    samples : int
        Number of bins, whatever the number of speeds in each.
    decays : int
        Number of decays.
    rough : tuple of (float, DecayLikelihood)
        The same with rising frictions.
    """

    log_likelihood: NDArray[np.float64]
    start: NDArray[np.float64]
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    deviation: NDArray[np.float64]
    samples: int
    decays: int
    rough: tuple[tuple[float, DecayLikelihood], ...] = ()

    def __add__(self, other: DecayLikelihood) -> DecayLikelihood:
        return DecayLikelihood(
            log_likelihood=self.log_likelihood + other.log_likelihood,
            start=self.start + other.start,
            gradient=self.gradient + other.gradient,
            information=self.information + other.information,
            deviation=self.deviation + other.deviation,
            samples=self.samples + other.samples,
            decays=self.decays + other.decays,
            rough=tuple(
                (friction, own + others)
                for (friction, own), (_, others) in zip(self.rough, other.rough, strict=True)
            ),
        )

    def emptied(self) -> DecayLikelihood:
        """A likelihood of the same shape that says nothing."""
        return DecayLikelihood(
            log_likelihood=np.zeros_like(self.log_likelihood),
            start=np.zeros_like(self.start),
            gradient=np.zeros_like(self.gradient),
            information=np.zeros_like(self.information),
            deviation=np.zeros_like(self.deviation),
            samples=0,
            decays=0,
            rough=tuple((friction, likelihood.emptied()) for friction, likelihood in self.rough),
        )

    def integrated(self, friction: FrictionWeights | None = None) -> NDArray[np.float64]:
        """Log likelihood (n_places,), start and nuisances integrated over their Gaussian priors.

        Parameters
        ----------
        friction : FrictionWeights, optional
            Probability of frictions; smooth beads if not given, or not in the library.
        """
        smooth = self._integrated()
        if friction is None or not self.rough:
            return smooth
        nodes = np.array([0.0, *(value for value, _ in self.rough)])
        logs = np.stack([smooth, *(likelihood._integrated() for _, likelihood in self.rough)])
        return friction.mixed(nodes, logs)

    def _integrated(self) -> NDArray[np.float64]:
        log_likelihood = np.empty(self.log_likelihood.shape)
        n_z = self.gradient.shape[-1]
        decays = max(self.decays, 1)
        part = 1.0 / (1.0 + (decays - 1) / MOST_CYCLES)
        integrate(
            np.ascontiguousarray(part * self.gradient).reshape(-1, n_z),
            np.ascontiguousarray(part * self.information).reshape(-1, n_z, n_z),
            log_likelihood.reshape(-1),
        )
        # Cycles start alike: a sum over many would favour restitutions that forget their starts.
        log_likelihood += part * self.log_likelihood + self.start / decays
        if log_likelihood.ndim == 1:
            return np.asarray(log_likelihood)
        weight = np.exp(-0.5 * SCALES**2)
        return np.asarray(log_sum(log_likelihood, weight / weight.sum()))

    def deviation_at(self, place: int) -> float:
        """Sum of the squares of the whitened residuals at a point, for the likeliest nuisances.

        At the expected nuisances it would be large where these are known badly: those of grains
        are, by a tenth and more of their speed.
        """
        n_places, n_z = self.gradient.shape[-2:]
        gradient = self.gradient.reshape(-1, n_places, n_z)[:, place]
        information = self.information.reshape(-1, n_places, n_z, n_z)[:, place]
        likeliest = np.linalg.solve(np.eye(n_z) + information, gradient[..., None])[..., 0]
        gain = np.einsum('sz,sz->s', gradient, likeliest)
        curved = np.einsum('sz,szy,sy->s', likeliest, information, likeliest)
        scale = (np.atleast_2d(self.log_likelihood)[:, place] + 0.5 * gain).argmax()
        deviation = np.atleast_2d(self.deviation)[:, place] - 2.0 * gain + curved
        return max(float(deviation[scale]), 0.0)
