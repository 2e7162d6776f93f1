"""Laws of the normal restitution of two beads: constant, uniformly random, viscoelastic."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.numerics.counter_rng import hashed, uniform

# The laws.
CONSTANT, UNIFORM, VISCOELASTIC = range(3)

# Müller, Pöschel 2011, Phys. Rev. E 84, 021302: numerator and denominator.
_C1 = 0.501086
_B1, _B2, _B3, _B4 = 0.501086, 1.15345, 0.577977, 0.532178


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformRestitution:
    """A restitution drawn for each collision, uniform in mean ± width / 2.

    Parameters
    ----------
    mean : float, 0 to 1
    width : float, >= 0
        Full width; the range must lie within 0 to 1.
    """

    mean: float
    width: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ViscoelasticRestitution:
    """The restitution of viscoelastic spheres, which falls with the impact speed.

    Parameters
    ----------
    value : float, 0 to 1, exclusive
    at_speed : float, [m/s], > 0
        Normal speed of the impact that leaves this restitution; 1 in the limit of slow impacts.

    References
    ----------
    Müller, Pöschel 2011, Phys. Rev. E 84, 021302, the Padé form.
    """

    value: float
    at_speed: float


Restitution = float | UniformRestitution | ViscoelasticRestitution


@compiled
def viscoelastic_restitution(argument: float) -> float:
    """Restitution of viscoelastic spheres; the argument goes with speed^(1/10)."""
    z = argument
    return (1.0 + _C1 * z) / (1.0 + z * (_B1 + z * (_B2 + z * (_B3 + z * _B4))))


@inlined
def random_restitution(
    mean: float, width: float, key: np.uint64, beads: tuple[int, int], counts: tuple[int, int]
) -> float:
    """Random restitution from the numbers of both beads and their counts of collisions.

    It depends on nothing else, so the order of computation cannot change it.

    Parameters
    ----------
    mean, width : float
    key : uint64
    beads, counts : tuple of 2 ints
        Original numbers, the smaller first; changes of velocity of each.
    """
    inner = hashed(hashed(hashed(key, beads[0]), beads[1]), counts[0])
    return mean + width * (uniform(inner, counts[1]) - 0.5)


def viscoelastic_scale(law: ViscoelasticRestitution) -> tuple[float, float]:
    """Argument of the Padé form at the given speed, and the inverse of that speed.

    Raises
    ------
    SimulationError
        For a restitution outside (0, 1), or a speed that is not positive.
    """
    if not (0.0 < law.value < 1.0 and math.isfinite(law.at_speed) and law.at_speed > 0.0):
        raise SimulationError(
            'restitution', f'{law!r}', 'give a value between 0 and 1 at a positive speed'
        )
    low, high = 0.0, 1.0
    while viscoelastic_restitution(high) > law.value:
        high *= 2.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if viscoelastic_restitution(middle) > law.value else (low, middle)
        )
    return 0.5 * (low + high), 1.0 / law.at_speed
