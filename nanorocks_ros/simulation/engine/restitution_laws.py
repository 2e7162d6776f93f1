"""How much of the normal relative velocity a collision of two beads leaves."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.numerics.counter_rng import hashed, uniform

# The laws.
CONSTANT, UNIFORM, VISCOELASTIC = range(3)

# Müller, Pöschel 2011, Phys. Rev. E 84, 021302: numerator and denominator.
_C1 = 0.501086
_B1, _B2, _B3, _B4 = 0.501086, 1.15345, 0.577977, 0.532178


@compiled
def viscoelastic(argument: float) -> float:
    """Restitution of viscoelastic spheres; the argument goes with speed^(1/10)."""
    z = argument
    return (1.0 + _C1 * z) / (1.0 + z * (_B1 + z * (_B2 + z * (_B3 + z * _B4))))


@inlined
def drawn(
    mean: float, width: float, key: np.uint64, beads: tuple[int, int], counts: tuple[int, int]
) -> float:
    """A restitution that depends on who collides and how often each has collided before.

    Nothing else: the order in which the events of a gas are worked out cannot change it.

    Parameters
    ----------
    mean, width : float
    key : uint64
    beads, counts : tuple of 2 ints
        Original numbers, the smaller first; changes of velocity of each.
    """
    inner = hashed(hashed(hashed(key, beads[0]), beads[1]), counts[0])
    return mean + width * (uniform(inner, counts[1]) - 0.5)
