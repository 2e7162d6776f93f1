"""Rates of collisions below a speed, by the kinetic theory of `confined_theory`.

Derived in docs/method/clusters.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.physics.confined_theory import confined_gas

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from nanorocks_ros.experiment.trays import Tray

MEASURES = 'normal', 'total'

# Mean of |x| of a normal law of variance 1.
_MEAN = math.sqrt(2.0 / math.pi)
_ALIKE = 1e-3
_SMALL = 0.01
# Nodes, in the logarithm of a speed over the mean one.
_LOG_SPEEDS = np.linspace(math.log(1e-6), math.log(1e4), 800)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowContacts:
    """Contacts of two beads by relative speed, at a mean projected speed of 1 m/s.

    Make one with `slow_contacts`.

    Parameters
    ----------
    rates : ndarray (n,), [1/m]
        Contacts of a bead per projected path length, of each kind.
    normal, tangential : ndarray (n,), [m^2/s^2]
        Variance of a component of the relative velocity of the beads of that kind: along the
        line of centres, and across it.
    """

    rates: NDArray[np.float64]
    normal: NDArray[np.float64]
    tangential: NDArray[np.float64]
    _curves: dict[str, NDArray[np.float64]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def rate(self) -> float:
        """All contacts of a bead per projected path length, kappa, [1/m]."""
        return float(self.rates.sum())

    def interpolated_rate_below(
        self, speed: ArrayLike, measure: str = 'normal'
    ) -> NDArray[np.float64]:
        """`rate_below`, interpolated between nodes that are computed once.

        Raises
        ------
        ConfigurationError
            For another measure.
        """
        return np.asarray(np.exp(np.interp(np.log(speed), _LOG_SPEEDS, self._log_curve(measure))))

    def summed_rate_below(
        self,
        speed: NDArray[np.float64],
        mean: NDArray[np.float64],
        weights: NDArray[np.float64],
        measure: str = 'normal',
    ) -> NDArray[np.float64]:
        """`interpolated_rate_below` at some speeds, (n,), summed with weights over mean speeds.

        Parameters
        ----------
        speed : ndarray (n,), [m/s]
        mean : ndarray (m,), [m/s]
            Projected.
        weights : ndarray (m,)

        Raises
        ------
        ConfigurationError
            For another measure.
        """
        sums = np.empty(speed.size)
        curve = self._log_curve(measure)
        _sum_slower(np.log(speed), np.log(mean), weights, _LOG_SPEEDS, curve, sums)
        return sums

    def summed_log_rate_below(
        self, speed: NDArray[np.float64], mean: NDArray[np.float64], measure: str = 'normal'
    ) -> NDArray[np.float64]:
        """Logarithm of `interpolated_rate_below`, summed over mean speeds."""
        ratio = np.log(speed)[:, np.newaxis] - np.log(mean)
        return np.asarray(np.interp(ratio, _LOG_SPEEDS, self._log_curve(measure)).sum(axis=1))

    def _log_curve(self, measure: str) -> NDArray[np.float64]:
        if measure not in self._curves:
            self._curves[measure] = np.log(self.rate_below(np.exp(_LOG_SPEEDS), measure))
        return self._curves[measure]

    def rate_below(self, speed: ArrayLike, measure: str = 'normal') -> NDArray[np.float64]:
        """Contacts per projected path length, [1/m], below a relative speed.

        Parameters
        ----------
        speed : array_like
        measure : 'normal' or 'total'
            Component of the relative velocity along the line of centres, or its modulus.

        Raises
        ------
        ConfigurationError
            For another measure.
        """
        if measure not in MEASURES:
            raise ConfigurationError(
                'sticking measure', f'{measure!r}', f'choose of {", ".join(MEASURES)}'
            )
        square = np.square(np.asarray(speed, dtype=np.float64))[..., np.newaxis]
        normal, across = 2.0 * self.normal, 2.0 * self.tangential
        if measure == 'normal':
            share = -np.expm1(-square / normal)
        else:
            share = _sum_of_exponentials(square, normal, across)
        return np.asarray(share @ self.rates)


@lru_cache(maxsize=16)
def slow_contacts(
    tray: Tray, restitution: float = 0.89, wall_restitution: float = 0.97
) -> SlowContacts:
    """Contacts in a tray that cools by Haff's law.

    Parameters
    ----------
    tray : Tray
    restitution, wall_restitution : float, [0, 1]
        They determine the ratio of vertical to horizontal energy; contacts depend little on it.

    Raises
    ------
    ConfigurationError
        For a restitution outside [0, 1], or a tray too crowded for the theory.
    FitError
        When there is no such steady state.
    """
    gas = confined_gas(tray)
    temperature = gas.cooling(restitution, wall_restitution).granular_temperature
    sums = temperature[:, np.newaxis] + temperature
    squares = gas.contacts.squares
    normal = np.einsum('abqi,abi->abq', squares, sums)
    tangential = 0.5 * (sums.sum(axis=-1)[..., np.newaxis] - normal)
    counts = gas.beads.counts / gas.beads.counts.sum()
    # Only approaching beads count: half of the mean modulus.
    rates = counts[:, np.newaxis, np.newaxis] * gas.contacts.pairs * np.sqrt(normal) * 0.5 * _MEAN
    approaching = rates > 0.0
    return SlowContacts(
        rates=rates[approaching], normal=normal[approaching], tangential=tangential[approaching]
    )


def _sum_of_exponentials(
    value: NDArray[np.float64], first: NDArray[np.float64], second: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Probability that the sum of two exponential variates of given means is below a value.

    The square of a relative velocity is such a sum: along the line of centres, since the collision
    rate is proportional to the speed, and across it, with two components.
    """
    second = np.where(np.abs(second / first - 1.0) < _ALIKE, first * (1.0 + _ALIKE), second)
    exact = (second * np.expm1(-value / second) - first * np.expm1(-value / first)) / (
        first - second
    )
    # The series, where the difference would cancel.
    small = 0.5 * value**2 / (first * second) * (1.0 - value * (1.0 / first + 1.0 / second) / 3.0)
    return np.asarray(np.where(value < _SMALL * np.minimum(first, second), small, exact))


@compiled
def _sum_slower(
    speeds: NDArray[np.float64],
    means: NDArray[np.float64],
    weights: NDArray[np.float64],
    nodes: NDArray[np.float64],
    curve: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Sum over mean speeds at each speed; all as logarithms, with a curve at even nodes."""
    step = (nodes[-1] - nodes[0]) / (nodes.size - 1)
    last = nodes.size - 1.0
    for i in range(speeds.size):
        total = 0.0
        for k in range(means.size):
            # The curve is constant beyond its ends.
            at = min(max((speeds[i] - means[k] - nodes[0]) / step, 0.0), last)
            cell = min(int(at), nodes.size - 2)
            value = curve[cell] + (at - cell) * (curve[cell + 1] - curve[cell])
            total += weights[k] * math.exp(value)
        sums[i] = total
