"""The restitution by a law of the impact speed, where one number does not describe it.

The law is 1 - restitution = (1 - restitution at the reference) (v / v_ref)^exponent. Both unknowns
have a joint posterior, from which follow the restitution at any speed and that which loses as much
energy in the contacts that were seen.

Tested by ``test/inference/contacts/test_restitution_law.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RectBivariateSpline

from nanorocks_ros.inference.likelihood_1d import Likelihood1D, Posterior1D
from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.impact_likelihoods import Impacts

# Points of the posterior along each axis, and the depth of the log likelihood at which it ends.
_RESTITUTIONS, _EXPONENTS, _DEPTH = 81, 241, 18.0
# Points of the posterior of one restitution, and standard deviations beyond its ends.
_POINTS, _REACH = 1001, 5.0
# A spread below this part of the range of what is likely is left out.
_NARROW = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class RestitutionLaw:
    """Posterior of the restitution as a function of the impact speed.

    Parameters
    ----------
    speed : float, [m/s]
        Reference speed.
    restitutions, exponents, probabilities : ndarray (n,)
        Points of the posterior, and their probabilities, which sum to 1: restitution at the
        reference speed, exponent.
    bias : float
        Standard deviation of a systematic error that is the same at all speeds.
    impact_speeds : ndarray (m,), [m/s]
        Of the contacts that were seen.
    gain : float
        1 + restitution where the impact speeds hold if the restitution is that of the reference
        speed, and change with it as of collisions seen in projection; 0: they are measured.
    """

    speed: float
    restitutions: NDArray[np.float64]
    exponents: NDArray[np.float64]
    probabilities: NDArray[np.float64]
    bias: float
    impact_speeds: NDArray[np.float64]
    gain: float = 0.0

    def at(self, speed: float) -> Posterior1D:
        """The restitution at an impact speed, [m/s]."""
        powers = (speed / self.speed) ** self.exponents
        return self._posterior(np.maximum(1.0 - (1.0 - self.restitutions) * powers, 0.0))

    @property
    def energy_weighted(self) -> Posterior1D:
        """The constant restitution that loses as much energy in the contacts that were seen.

        The root of the mean square of the restitutions of single contacts, each weighted by the
        square of its impact speed.
        """
        return self._posterior(_energy_weighted(self))

    def up_to(self, exponent: float) -> RestitutionLaw | None:
        """The law if its exponent is from 0 to some value; None if that is not likely at all."""
        inside = (self.exponents >= 0.0) & (self.exponents <= exponent)
        if not inside.any():
            return None
        weight = self.probabilities[inside]
        return replace(
            self,
            restitutions=self.restitutions[inside],
            exponents=self.exponents[inside],
            probabilities=weight / weight.sum(),
        )

    def corrected(self, factor: float, error: float) -> RestitutionLaw:
        """The law with all losses times a factor, and a further error of the restitution."""
        return replace(
            self,
            restitutions=np.clip(1.0 - factor * (1.0 - self.restitutions), 0.0, 1.0),
            bias=math.hypot(self.bias, error),
        )

    def _posterior(self, values: NDArray[np.float64]) -> Posterior1D:
        """Posterior of a function of the law, given at its points, with the systematic error."""
        low = max(float(values.min()) - _REACH * self.bias, 0.0)
        high = min(float(values.max()) + _REACH * self.bias, 1.0)
        axis = np.linspace(low, high, _POINTS)
        step = axis[1] - axis[0]
        if not step > 0.0:
            return Posterior1D(restitution=axis[:1], probability=np.ones(1))
        # Each point goes to the two nearest of the axis, so that the mean stays.
        place = np.clip((values - low) / step, 0.0, _POINTS - 1.000001)
        node = place.astype(np.int64)
        part = place - node
        weight = np.bincount(node, self.probabilities * (1.0 - part), _POINTS)
        weight += np.bincount(node + 1, self.probabilities * part, _POINTS)
        if self.bias > _NARROW * (high - low):
            kernel = np.exp(-0.5 * ((axis - axis[_POINTS // 2]) / self.bias) ** 2)
            weight = np.convolve(weight, kernel, mode='same')
        return Posterior1D(restitution=axis, probability=weight / weight.sum())


def law_posterior(
    grid: tuple[NDArray[np.float64], NDArray[np.float64]],
    logs: NDArray[np.float64],
    impacts: Impacts,
    biases: tuple[float, float],
) -> RestitutionLaw:
    """The law from the log likelihood of its two unknowns; flat priors.

    Parameters
    ----------
    grid : tuple of 2 ndarrays
        Restitutions at the reference speed, (r,), and exponents, (p,), both rising; 4 or more.
    logs : ndarray (r, p)
    impacts : Impacts
        Contacts; the reference speed is the geometric mean of their speeds.
    biases : tuple of 2 floats
        Standard deviations of systematic errors of the restitution at all speeds, and of the
        exponent.
    """
    restitutions, exponents = grid
    smeared = np.array(
        [
            Likelihood1D(restitution=exponents, log_likelihood=row).convolved(biases[1])
            .log_likelihood
            for row in logs
        ]
    )  # fmt: skip
    spline = RectBivariateSpline(restitutions, exponents, smeared)
    ends = [(restitutions[0], restitutions[-1]), (exponents[0], exponents[-1])]
    for _ in range(2):
        axes = [
            np.linspace(*end, number)
            for end, number in zip(ends, (_RESTITUTIONS, _EXPONENTS), strict=True)
        ]
        fine = spline(*axes)
        likely = fine > fine.max() - _DEPTH
        ends = [_around(axes[k], likely.any(axis=1 - k)) for k in range(2)]
    weight = np.exp(fine - fine.max())
    values, powers = np.meshgrid(*axes, indexing='ij')
    return RestitutionLaw(
        speed=impacts.reference,
        restitutions=values[likely],
        exponents=powers[likely],
        probabilities=weight[likely] / weight[likely].sum(),
        bias=biases[0],
        impact_speeds=impacts.speeds,
        gain=impacts.gain,
    )


def _around(axis: NDArray[np.float64], likely: NDArray[np.bool_]) -> tuple[float, float]:
    """Ends of the part of an axis that is likely, one step further out."""
    places = np.flatnonzero(likely)
    return float(axis[max(places[0] - 1, 0)]), float(axis[min(places[-1] + 1, axis.size - 1)])


def _energy_weighted(law: RestitutionLaw) -> NDArray[np.float64]:
    """Energy-weighted restitution at each point of the law, (n,)."""
    distinct, place = np.unique(law.exponents, return_inverse=True)
    order = np.argsort(place, kind='stable')
    means = np.empty(law.restitutions.size)
    ratios = law.impact_speeds / law.speed
    _set_means(means, law.restitutions, order, place.astype(np.int64), distinct, ratios, law.gain)
    return means


@compiled
def _set_means(
    means: NDArray[np.float64],
    restitutions: NDArray[np.float64],
    order: NDArray[np.int64],
    place: NDArray[np.int64],
    exponents: NDArray[np.float64],
    ratios: NDArray[np.float64],
    gain: float,
) -> None:
    """Set the energy-weighted restitutions of points, which `order` sorts by their exponents."""
    last = -1
    powers = np.empty(ratios.size)
    for k in order:
        exponent, mean = exponents[place[k]], 1.0 - restitutions[k]
        if place[k] != last:
            last = place[k]
            powers = ratios**exponent
        scale = gain / (2.0 - mean) if gain > 0.0 else 1.0
        unit = mean * scale**exponent
        left, total = 0.0, 0.0
        for i in range(ratios.size):
            loss, ratio = min(unit * powers[i], 1.0), ratios[i]
            if gain > 0.0:
                # The speed is that over 1 + restitution, to second order.
                change = exponent * (loss - mean) / (2.0 - 0.5 * (loss + mean))
                loss = min(loss * (1.0 + change + 0.5 * change * change), 1.0)
                ratio *= gain / (2.0 - loss)
            left += ((1.0 - loss) * ratio) ** 2
            total += ratio * ratio
        means[k] = math.sqrt(left / total)
