"""Kinetic theory of rough spheres: partition of energy between translation and rotation.

Mean-field theory of a homogeneous gas of equal, solid, inelastic, rough spheres without walls:
velocities and spins Gaussian and independent, both restitutions constant. A temperature is the
mean energy of one degree of freedom, T = m <v^2> / 3 and R T = I <w^2> / 3, both with three of
them, so that R = 1 is equipartition. In a real gas spin axis and velocity are correlated
(Brilliantov and others 2007), and the walls of a tray cool translation and rotation at different
rates: ``docs/method/rotation.md`` compares both with simulation.

References
----------
[HZ] Huthmann, Zippelius 1997, Phys. Rev. E 56, R6275 (cond-mat/9708093).
[SKS] Santos, Kremer, dos Santos 2011, Phys. Fluids 23, 030604 (arXiv:1009.6180).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.kinetic_theory import PROJECTION, check_positive, check_restitution

if TYPE_CHECKING:
    from numpy.typing import NDArray

# I / (m r^2) of a solid sphere.
SOLID_SPHERE = 0.4
# Loss of temperature of a bead per collision: 4 times the `RoughRates` of the pair, half of it for
# each bead, divided by 3/2.
_PER_COLLISION = 4.0 / 3.0
# Ratio of mean to root mean square speed of the Maxwell distribution.
_MEAN_OF_RMS = math.sqrt(8.0 / (3.0 * math.pi))


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughRates:
    """Mean change of the temperatures per collision; s is the number of collisions of a bead.

    dT/ds = -(4/3) (loss - exchange R) T for the translation, and
    d(RT)/ds = (4/3) (exchange - drain R) T for the rotation.

    Parameters
    ----------
    loss, exchange, drain : float
        A, B and C of [HZ]: (1 - e^2)/4 + h (1 - h), h^2/q and (h/q)(1 - h/q) with
        h = q (1 + b) / (2 (1 + q)), q = 2/5.
    """

    loss: float
    exchange: float
    drain: float


def rough_rates(restitution: float, tangential_restitution: float) -> RoughRates:
    """Losses of translation and rotation at a collision of two rough beads.

    Parameters
    ----------
    restitution : float, [0, 1]
    tangential_restitution : float, [-1, 1]
        -1: smooth; 1: the tangential velocity of the surfaces is reversed.

    Raises
    ------
    ConfigurationError
        When a value is outside its range.

    References
    ----------
    [HZ]; derivation in docs/method/rotation.md.
    """
    check_restitution(restitution=restitution)
    if not -1.0 <= tangential_restitution <= 1.0:
        raise ConfigurationError(
            'tangential_restitution', f'{tangential_restitution!r}', 'give a number from -1 to 1'
        )
    q = SOLID_SPHERE
    push = 0.5 * q * (1.0 + tangential_restitution) / (1.0 + q)
    return RoughRates(
        loss=0.25 * (1.0 - restitution**2) + push * (1.0 - push),
        exchange=push**2 / q,
        drain=push / q * (1.0 - push / q),
    )


def rough_temperature_ratio(restitution: float, tangential_restitution: float) -> float:
    """Asymptotic ratio of rotational to translational temperature of a cooling gas.

    Parameters
    ----------
    restitution : float, [0, 1]
    tangential_restitution : float, (-1, 1]

    Raises
    ------
    ConfigurationError
        When a value is outside its range: smooth beads keep their spin.

    References
    ----------
    [HZ]: K + sqrt(K^2 + 1) with K = (A - C) / (2 B); confirmed by [SKS] without the Gaussian
    assumption.
    """
    return _ends(_rough(restitution, tangential_restitution))[0]


def temperature_ratio_course(
    collisions: NDArray[np.float64],
    restitution: float,
    tangential_restitution: float,
    start: float = 0.0,
) -> NDArray[np.float64]:
    """Ratio of rotational to translational temperature after some collisions of each bead.

    Parameters
    ----------
    collisions : ndarray, >= 0
    restitution : float, [0, 1]
    tangential_restitution : float, (-1, 1]
    start : float, >= 0
        Initial ratio; 0: no rotation.

    Raises
    ------
    ConfigurationError
        When a value is outside its range.
    """
    rates = _rough(restitution, tangential_restitution)
    if not (math.isfinite(start) and start >= 0.0):
        raise ConfigurationError('start', f'{start!r}', 'give a ratio of 0 or more')
    high, low = _ends(rates)
    gone = np.exp(-_PER_COLLISION * rates.exchange * (high - low) * np.asarray(collisions))
    gone *= (start - high) / (start - low)
    temperature_ratio: NDArray[np.float64] = (high - low * gone) / (1.0 - gone)
    return temperature_ratio


def smooth_equivalent(restitution: float, tangential_restitution: float) -> float:
    """Restitution of smooth beads whose translation cools as fast as that of rough beads.

    For the asymptotic state of a homogeneous gas: the restitution that a fit for smooth beads
    gives for rough ones.

    Parameters
    ----------
    restitution : float, [0, 1]
    tangential_restitution : float, [-1, 1]

    Raises
    ------
    ConfigurationError
        When a value is outside its range.
    """
    rates = rough_rates(restitution, tangential_restitution)
    back = rates.exchange * _ends(rates)[0] if rates.exchange > 0.0 else 0.0
    return math.sqrt(1.0 - 4.0 * (rates.loss - back))


def rms_spin(mean_projected_speed: float, diameter: float, ratio: float = 1.0) -> float:
    """Root mean square spin of beads with a mean projected speed, [rad/s].

    Parameters
    ----------
    mean_projected_speed : float, [m/s], > 0
        Of an isotropic Maxwell distribution.
    diameter : float, [m], > 0
    ratio : float, >= 0
        Ratio of rotational to translational temperature; 1: equipartition.

    Raises
    ------
    ConfigurationError
        When a value is outside its range.
    """
    check_positive(mean_projected_speed=mean_projected_speed, diameter=diameter)
    if not (math.isfinite(ratio) and ratio >= 0.0):
        raise ConfigurationError('ratio', f'{ratio!r}', 'give a ratio of 0 or more')
    rms_speed = mean_projected_speed / PROJECTION / _MEAN_OF_RMS
    return math.sqrt(ratio / SOLID_SPHERE) * rms_speed / (0.5 * diameter)


def _rough(restitution: float, tangential_restitution: float) -> RoughRates:
    rates = rough_rates(restitution, tangential_restitution)
    if rates.exchange == 0.0:
        raise ConfigurationError(
            'tangential_restitution', '-1, smooth', 'give more: smooth beads keep their spin'
        )
    return rates


def _ends(rates: RoughRates) -> tuple[float, float]:
    """Stable and unstable fixed point of the temperature ratio; the second is negative."""
    k = 0.5 * (rates.loss - rates.drain) / rates.exchange
    root = math.hypot(k, 1.0)
    # The product of both is -1: no difference of large numbers.
    high = k + root if k >= 0.0 else 1.0 / (root - k)
    return high, -1.0 / high
