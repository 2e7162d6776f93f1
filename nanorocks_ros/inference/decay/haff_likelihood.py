"""Likelihood of the mean speeds of a cooling gas, for a Haff time and the noise of the gas.

The model is derived in :mod:`nanorocks_ros.inference.decay.haff_fit`. A live graph fits each tray
twice a second with hundreds of evaluations each, so one evaluation is one compiled call, without
exponentials in the covariance: exp(-|s - s'|) is a ratio of (1 + t/tau).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.decay.covariance_solver import inverse_with_columns, whiten
from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    _Arrays = tuple[
        NDArray[np.float64],
        NDArray[np.intp],
        NDArray[np.intp],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
    ]

# Prior standard deviations of the logarithms of the strength q and of the quick part.
_SPREAD_STRENGTH, _SPREAD_QUICK = 0.5, 1.0
# Step of the numerical derivative: the third root of the precision.
_STEP = 6e-6
_PARAMETERS = 4


@dataclass(frozen=True, slots=True)
class Decay:
    """Times, and ln v averaged over groups of neighbours with its variance.

    Parameters
    ----------
    time : ndarray (n,), [s]
        Of all speeds, in order.
    starts, counts : ndarrays of int (m,)
        First member and size of each group.
    log_speed, variance : ndarrays (m,)
        Mean of the logarithm of the speeds [m/s] of a group, and its variance by the errors.
    inner_distance : ndarray (m,), [s]
        Mean time between two members of a group.
    usual : ndarray (2,)
        Prior means of the logarithms of the strength q and of the quick part.
    """

    time: NDArray[np.float64]
    starts: NDArray[np.intp]
    counts: NDArray[np.intp]
    log_speed: NDArray[np.float64]
    variance: NDArray[np.float64]
    inner_distance: NDArray[np.float64]
    usual: NDArray[np.float64]

    def generalised(
        self, parameters: NDArray[np.float64]
    ) -> tuple[float, float, NDArray[np.float64]]:
        """Minus twice the log posterior, the best ln v0, the information on (ln v0, ln tau).

        Parameters
        ----------
        parameters : ndarray (4,)
            Logarithms of tau [s], of the strength q, of the variance of the quick part, and of
            the scale of errors.
        """
        cost, log_v0, i00, i01, i11 = _generalised(parameters, *self._arrays())
        return cost, log_v0, np.array([[i00, i01], [i01, i11]])

    def cost(self, parameters: NDArray[np.float64]) -> float:
        """Minus twice the log posterior."""
        return self.generalised(parameters)[0]

    def cost_and_slope(self, parameters: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """The cost and its derivatives by the parameters, (4,)."""
        slope = np.empty(_PARAMETERS)
        return _cost_and_slope(parameters, slope, *self._arrays()), slope

    def rate_variance(self, parameters: NDArray[np.float64]) -> float:
        """Variance of ln(1 / (v0 tau)) = -ln v0 - ln tau."""
        return float(np.linalg.inv(self.generalised(parameters)[2]).sum())

    def _arrays(self) -> _Arrays:
        return (
            self.time,
            self.starts,
            self.counts,
            self.log_speed,
            self.variance,
            self.inner_distance,
            self.usual,
        )


@compiled
def _cost_and_slope(
    parameters: NDArray[np.float64],
    slope: NDArray[np.float64],
    time: NDArray[np.float64],
    starts: NDArray[np.intp],
    counts: NDArray[np.intp],
    log_speed: NDArray[np.float64],
    variance: NDArray[np.float64],
    inner_distance: NDArray[np.float64],
    usual: NDArray[np.float64],
) -> float:
    """See `Decay.cost_and_slope`; the derivative by tau, which enters everywhere, is numerical."""
    data = (time, starts, counts, log_speed, variance, inner_distance, usual)
    near = parameters.copy()
    step = _STEP * max(1.0, abs(parameters[0]))
    near[0] = parameters[0] + step
    above = _generalised(near, *data)[0]
    near[0] = parameters[0] - step
    slope[0] = (above - _generalised(near, *data)[0]) / (2.0 * step)
    growth, columns = _columns(parameters[0], time, starts, counts, log_speed)
    smooth, rough, white = _covariances(
        parameters, growth, time, starts, counts, variance, inner_distance
    )
    factor = smooth + rough
    whitened = columns.copy()
    log_determinant = whiten(factor, white, whitened)
    cost, log_v0, i00, i01, i11 = _summed(parameters, whitened, log_determinant, usual)
    solved = inverse_with_columns(factor, columns)
    slope[1], slope[2], slope[3] = 0.0, 0.0, 0.0
    determinant = i00 * i11 - i01 * i01
    n = growth.size
    for i in range(n):
        zi0, zi1 = solved[i, 0], solved[i, 1]
        gi = solved[i, 2] - log_v0 * zi0
        for j in range(i, n):
            zj0, zj1 = solved[j, 0], solved[j, 1]
            gj = solved[j, 2] - log_v0 * zj0
            # By an element of the covariance: log determinant, residuals, information, ln v0.
            by = solved[i, 3 + j] - gi * gj
            by -= (i11 * zi0 * zj0 - i01 * (zi0 * zj1 + zi1 * zj0) + i00 * zi1 * zj1) / determinant
            by -= (zi0 * gj + gi * zj0) / i00
            by *= 1.0 if i == j else 2.0
            slope[1] += by * smooth[i, j]
            slope[2] += by * rough[i, j]
            if i == j:
                slope[3] += 2.0 * by * white[i]
    slope[1] += 2.0 * (parameters[1] - usual[0]) / (_SPREAD_STRENGTH * _SPREAD_STRENGTH)
    slope[2] += 2.0 * (parameters[2] - usual[1]) / (_SPREAD_QUICK * _SPREAD_QUICK)
    return cost


@compiled
def _generalised(
    parameters: NDArray[np.float64],
    time: NDArray[np.float64],
    starts: NDArray[np.intp],
    counts: NDArray[np.intp],
    log_speed: NDArray[np.float64],
    variance: NDArray[np.float64],
    inner_distance: NDArray[np.float64],
    usual: NDArray[np.float64],
) -> tuple[float, float, float, float, float]:
    """See `Decay.generalised`; the information as its three elements."""
    growth, columns = _columns(parameters[0], time, starts, counts, log_speed)
    smooth, rough, white = _covariances(
        parameters, growth, time, starts, counts, variance, inner_distance
    )
    log_determinant = whiten(smooth + rough, white, columns)
    return _summed(parameters, columns, log_determinant, usual)


@compiled
def _columns(
    log_tau: float,
    time: NDArray[np.float64],
    starts: NDArray[np.intp],
    counts: NDArray[np.intp],
    log_speed: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """1 + t/tau of each group, (m,); and (3, m): derivatives by ln v0 and ln tau, and the data."""
    tau = math.exp(log_tau)
    n = starts.size
    growth, columns = np.empty(n), np.ones((3, n))
    for i in range(n):
        s, slope = 0.0, 0.0
        for k in range(starts[i], starts[i] + counts[i]):
            age = time[k] / tau
            s += math.log1p(age)
            slope += age / (1.0 + age)
        s, slope = s / counts[i], slope / counts[i]
        growth[i] = math.exp(s)
        columns[1, i], columns[2, i] = slope, log_speed[i] + s
    return growth, columns


@compiled
def _covariances(
    parameters: NDArray[np.float64],
    growth: NDArray[np.float64],
    time: NDArray[np.float64],
    starts: NDArray[np.intp],
    counts: NDArray[np.intp],
    variance: NDArray[np.float64],
    inner_distance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Of the gas and its quick part, (m, m), from the diagonal on; and of the errors, (m,)."""
    tau, half = math.exp(parameters[0]), 0.5 * math.exp(parameters[1])
    quick, scale = math.exp(parameters[2]), math.exp(parameters[3])
    n = growth.size
    inverse = 1.0 / growth
    smooth, rough = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j in range(i, n):
            # exp(-gap), and exp(-gap / 0.1): the quick part is forgotten after about one
            # collision of each bead.
            kept = growth[i] * inverse[j]
            kept2 = kept * kept
            kept4 = kept2 * kept2
            smooth[i, j] = half * (kept - inverse[i] * inverse[j])
            rough[i, j] = quick * kept4 * kept4 * kept2
        # The average over a group varies less than the value in its middle.
        middle = time[starts[i] + counts[i] // 2]
        smooth[i, i] -= half * inner_distance[i] / (middle + tau)
    return smooth, rough, scale * scale * variance


@compiled
def _summed(
    parameters: NDArray[np.float64],
    columns: NDArray[np.float64],
    log_determinant: float,
    usual: NDArray[np.float64],
) -> tuple[float, float, float, float, float]:
    """Cost, ln v0 and information from whitened columns."""
    i00, i01, i11, weighted_log_speeds = 0.0, 0.0, 0.0, 0.0
    for i in range(columns.shape[1]):
        i00 += columns[0, i] * columns[0, i]
        i01 += columns[0, i] * columns[1, i]
        i11 += columns[1, i] * columns[1, i]
        weighted_log_speeds += columns[0, i] * columns[2, i]
    log_v0 = weighted_log_speeds / i00
    cost = log_determinant
    for i in range(columns.shape[1]):
        residual = columns[2, i] - log_v0 * columns[0, i]
        cost += residual * residual
    cost += ((parameters[1] - usual[0]) / _SPREAD_STRENGTH) ** 2
    cost += ((parameters[2] - usual[1]) / _SPREAD_QUICK) ** 2
    # Restricted likelihood: v0 and tau were fitted, which costs degrees of freedom. In
    # (ln v0, 1 / (v0 tau)), where the model is nearly linear: in ln tau the information
    # depends on tau itself, and would pull it up.
    cost += math.log(i00 * i11 - i01 * i01) + 2.0 * (log_v0 + parameters[0])
    return cost, log_v0, i00, i01, i11
