"""Rough spheres: how translation and rotation share the energy of a cooling gas.

Mean-field theory of a homogeneous gas of equal, solid, inelastic, rough spheres without walls:
velocities and spins Gaussian and independent, both restitutions constant. A temperature is the
mean energy of one degree of freedom, T = m <v^2> / 3 and R T = I <w^2> / 3, both with three of
them, so that R = 1 is equipartition. What a bead spins about and where it flies are correlated in
truth (Brilliantov and others 2007), and walls of a tray take translation and rotation unevenly:
``docs/method/rotation.md`` has both against simulation.

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
# Loss of temperature at a collision of each of two beads: 4 of `RoughRates` in each pair, of
# which a bead has half, over 3/2 for each temperature.
_PER_COLLISION = 4.0 / 3.0
# Mean speed over the root mean square of Maxwell's speeds.
_MEAN_OF_RMS = math.sqrt(8.0 / (3.0 * math.pi))


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughRates:
    """What a collision does to the temperatures on average, s counting those of each bead.

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
        -1: smooth; 1: the velocity of the surfaces turns round.

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
    """Temperature of the rotation over that of the translation that a cooling gas comes to.

    Parameters
    ----------
    restitution : float, [0, 1]
    tangential_restitution : float, (-1, 1]

    Raises
    ------
    ConfigurationError
        When a value is outside its range: smooth beads keep the spin that they have.

    References
    ----------
    [HZ]: K + sqrt(K^2 + 1) with K = (A - C) / (2 B); found good against a theory without the
    Gaussian by [SKS].
    """
    return _ends(_rough(restitution, tangential_restitution))[0]


def temperature_ratio_course(
    collisions: NDArray[np.float64],
    restitution: float,
    tangential_restitution: float,
    start: float = 0.0,
) -> NDArray[np.float64]:
    """The same ratio on the way, after so many collisions of each bead.

    Parameters
    ----------
    collisions : ndarray, >= 0
    restitution : float, [0, 1]
    tangential_restitution : float, (-1, 1]
    start : float, >= 0
        Ratio at 0; 0: no rotation.

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
    """Restitution of smooth beads whose translation cools as fast as that of rough ones does.

    In the state that a homogeneous gas comes to. This is what a decay says of rough beads to
    somebody who takes them for smooth.

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


def spin_of(mean_projected_speed: float, diameter: float, ratio: float = 1.0) -> float:
    """Root mean square spin of beads that fly so fast, [rad/s].

    Parameters
    ----------
    mean_projected_speed : float, [m/s], > 0
        Of Maxwell's speeds, even in all directions.
    diameter : float, [m], > 0
    ratio : float, >= 0
        Temperature of the rotation over that of the translation; 1: equipartition.

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
    """The ratio that attracts, and the negative one that repels."""
    k = 0.5 * (rates.loss - rates.drain) / rates.exchange
    root = math.hypot(k, 1.0)
    # The product of both is -1: no difference of large numbers.
    high = k + root if k >= 0.0 else 1.0 / (root - k)
    return high, -1.0 / high
