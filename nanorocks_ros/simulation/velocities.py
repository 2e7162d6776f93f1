"""Random velocities: after shaking, or Maxwellian.

Normal deviates come from Marsaglia's polar method with a logarithm of our own, see
`exponentials`: velocities are the same bits on every machine, and unlike a sum of uniform numbers
they have the right tails.

References
----------
Marsaglia, Bray 1964, A convenient method for generating normal variables, SIAM Rev. 6, 260.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.counter_rng import direction, hashed, uniform
from nanorocks_ros.numerics.exponentials import logarithm

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Deviation of each component of a Maxwellian gas of mean speed 1.
_DEVIATION = math.sqrt(math.pi / 8.0)


@compiled
def uniform_speeds(n: int, mean_speed: float, key: np.uint64, shake: int) -> NDArray[np.float64]:
    """Velocities after a shaking event: speeds uniform in [0, 2 mean), directions isotropic.

    Parameters
    ----------
    n : int
    mean_speed : float, [m/s]
        In space.
    key : uint64
    shake : int
        Number of the shaking event; each gives others.

    Returns
    -------
    ndarray (n, 3), [m/s]

    References
    ----------
    [B19], section on the simulations: uniform about the measured mean, directions random.
    """
    velocities = np.empty((n, 3))
    speeds_key = hashed(key, 2 * shake)
    directions_key = hashed(key, 2 * shake + 1)
    for i in range(n):
        speed = 2.0 * mean_speed * uniform(speeds_key, i)
        x, y, z = direction(hashed(directions_key, i))
        velocities[i, 0] = speed * x
        velocities[i, 1] = speed * y
        velocities[i, 2] = speed * z
    return velocities


@compiled
def maxwellian(
    masses: NDArray[np.float64], mean_speed: float, key: np.uint64, shake: int, equipartition: bool
) -> NDArray[np.float64]:
    """Velocities of a gas in equilibrium: each component of each bead is normal.

    Parameters
    ----------
    masses : ndarray (n,), [kg]
    mean_speed : float, [m/s]
        Expected over all beads, in space; those drawn scatter about it.
    key : uint64
    shake : int
        Number of the shaking event; each gives others.
    equipartition : bool
        Whether beads of all masses have the same mean kinetic energy, as in a gas of elastic
        beads; or else the same mean square velocity, the granular temperature per unit mass,
        as walls give it.

    Returns
    -------
    ndarray (n, 3), [m/s]
    """
    n = masses.size
    velocities = np.empty((n, 3))
    deviates_key = hashed(key, 2 * shake)
    mean = 0.0
    for i in range(n):
        mean += _speed_scale(masses[i], equipartition)
    mean /= n
    for i in range(n):
        deviation = _DEVIATION * mean_speed * (_speed_scale(masses[i], equipartition) / mean)
        bead_key = hashed(deviates_key, i)
        x, y, counter = normal_pair(bead_key, 0)
        z, _, _ = normal_pair(bead_key, counter)
        velocities[i, 0] = deviation * x
        velocities[i, 1] = deviation * y
        velocities[i, 2] = deviation * z
    return velocities


@compiled
def _speed_scale(mass: float, equipartition: bool) -> float:
    """Factor of the speed of a bead by its mass."""
    return 1.0 / math.sqrt(mass) if equipartition else 1.0


@compiled
def normal_pair(key: np.uint64, counter: int) -> tuple[float, float, int]:
    """Two normal deviates, and the counter after the numbers used."""
    while True:
        a = 2.0 * uniform(key, counter) - 1.0
        b = 2.0 * uniform(key, counter + 1) - 1.0
        counter += 2
        square = a * a + b * b
        if 0.0 < square < 1.0:
            stretch = math.sqrt(-2.0 * logarithm(square) / square)
            return a * stretch, b * stretch, counter
