"""How likely the mean speeds of a gas that cools are, for a Haff time and the noise of the gas.

The model and where it comes from stand in :mod:`nanorocks_ros.physics.haff_fit`. A live graph
fits each tray twice a second with hundreds of evaluations each, so one evaluation is one
compiled call, with no exponential for the elements of the covariance: exp(-|s - s'|) is a ratio
of (1 + t/tau).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Spread of the logarithms of the strength q and of the quick part, about what is usual.
_SPREAD_STRENGTH, _SPREAD_QUICK = 0.5, 1.0
# Steps of the numerical derivative: the third root of the precision.
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
        Logarithms of the strength q and of the quick part that are usual for so many beads.
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
        """The same and its derivatives by the parameters, (4,), by central differences."""
        slope = np.empty(_PARAMETERS)
        return _cost_and_slope(parameters, slope, *self._arrays()), slope

    def rate_variance(self, parameters: NDArray[np.float64]) -> float:
        """Variance of ln(1 / (v0 tau)) = -ln v0 - ln tau."""
        return float(np.linalg.inv(self.generalised(parameters)[2]).sum())

    def _arrays(self) -> tuple[NDArray[np.float64] | NDArray[np.intp], ...]:
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
    data = (time, starts, counts, log_speed, variance, inner_distance, usual)
    near = parameters.copy()
    for k in range(parameters.size):
        step = _STEP * max(1.0, abs(parameters[k]))
        near[k] = parameters[k] + step
        above = _generalised(near, *data)[0]
        near[k] = parameters[k] - step
        slope[k] = (above - _generalised(near, *data)[0]) / (2.0 * step)
        near[k] = parameters[k]
    return float(_generalised(parameters, *data)[0])


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
    tau, strength = math.exp(parameters[0]), math.exp(parameters[1])
    quick, scale = math.exp(parameters[2]), math.exp(parameters[3])
    n = starts.size
    # Rows: ln v0, ln tau, and what they have to explain.
    columns = np.ones((3, n))
    growth = np.empty(n)
    for i in range(n):
        s, slope = 0.0, 0.0
        for k in range(starts[i], starts[i] + counts[i]):
            age = time[k] / tau
            s += math.log1p(age)
            slope += age / (1.0 + age)
        s, slope = s / counts[i], slope / counts[i]
        growth[i] = math.exp(s)
        columns[1, i], columns[2, i] = slope, log_speed[i] + s
    covariance = np.empty((n, n))
    for i in range(n):
        for j in range(i, n):
            # exp(-gap), and exp(-gap / 0.1): the quick part is forgotten after about one
            # collision of each bead.
            kept = growth[i] / growth[j]
            kept2 = kept * kept
            kept4 = kept2 * kept2
            covariance[i, j] = 0.5 * strength * (kept - 1.0 / (growth[i] * growth[j]))
            covariance[i, j] += quick * kept4 * kept4 * kept2
        # The average over a group varies less than the value in its middle.
        middle = time[starts[i] + counts[i] // 2]
        covariance[i, i] -= 0.5 * strength * inner_distance[i] / (middle + tau)
        covariance[i, i] += scale * scale * variance[i]
    cost = _whiten(covariance, columns)
    i00, i01, i11, known = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        i00 += columns[0, i] * columns[0, i]
        i01 += columns[0, i] * columns[1, i]
        i11 += columns[1, i] * columns[1, i]
        known += columns[0, i] * columns[2, i]
    log_v0 = known / i00
    for i in range(n):
        residual = columns[2, i] - log_v0 * columns[0, i]
        cost += residual * residual
    cost += ((parameters[1] - usual[0]) / _SPREAD_STRENGTH) ** 2
    cost += ((parameters[2] - usual[1]) / _SPREAD_QUICK) ** 2
    # Restricted likelihood: v0 and tau were fitted, which costs degrees of freedom. In
    # (ln v0, 1 / (v0 tau)), where the model is nearly linear: in ln tau the information
    # depends on tau itself, and would pull it up.
    cost += math.log(i00 * i11 - i01 * i01) + 2.0 * (log_v0 + parameters[0])
    return cost, log_v0, i00, i01, i11


@compiled
def _whiten(covariance: NDArray[np.float64], columns: NDArray[np.float64]) -> float:
    """Solve with the Cholesky factor of a covariance, in place; its log determinant.

    Matrices this small are no work for a threaded BLAS: its threads wait for one another, which
    on a busy machine made a fit take seconds, and their order may change the last digit.

    Parameters
    ----------
    covariance : ndarray (n, n)
        The part on and above the diagonal is used, and overwritten.
    columns : ndarray (k, n)
        Each row is replaced by its solution.
    """
    n = covariance.shape[0]
    log_determinant = 0.0
    for j in range(n):
        pivot = math.sqrt(covariance[j, j])
        log_determinant += 2.0 * math.log(pivot)
        for i in range(j, n):
            covariance[j, i] /= pivot
        for k in range(j + 1, n):
            factor = covariance[j, k]
            for i in range(k, n):
                covariance[k, i] -= covariance[j, i] * factor
        for c in range(columns.shape[0]):
            columns[c, j] /= covariance[j, j]
            factor = columns[c, j]
            for i in range(j + 1, n):
                columns[c, i] -= covariance[j, i] * factor
    return log_determinant
