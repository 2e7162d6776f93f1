"""Laws of the normal restitution: constant, uniformly random, viscoelastic, a power of speed.

`LAWS` is the register: a law of settings, films, sweeps and libraries is one of its names.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.numerics.counter_rng import hashed, uniform

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Kinds of laws in compiled code; a table of pairs of species is constant.
CONSTANT, UNIFORM, VISCOELASTIC, POWER = range(4)

# Müller, Pöschel 2011, Phys. Rev. E 84, 021302: numerator and denominator.
_C1 = 0.501086
_B1, _B2, _B3, _B4 = 0.501086, 1.15345, 0.577977, 0.532178
# Of the speed, in the argument of that form.
_VISCOELASTIC_POWER = 0.1


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


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLawRestitution:
    """A restitution that falls from 1 by a loss that goes with a power of the impact speed.

    Where the loss would be above 1, the restitution is 0.

    Parameters
    ----------
    value : float, 0 to 1
    at_speed : float, [m/s], > 0
        Normal speed of the impact that leaves this restitution.
    exponent : float, >= 0
        0 is constant; about 1/5 for viscoelastic spheres that lose little.
    """

    value: float
    at_speed: float
    exponent: float


SpeedLaw = ViscoelasticRestitution | PowerLawRestitution
"""A law by which the restitution depends on the impact speed."""
Restitution = float | UniformRestitution | SpeedLaw


@dataclass(frozen=True, slots=True, kw_only=True)
class LawTerms:
    """What laws are made of; each takes what it needs.

    Parameters
    ----------
    value : float, 0 to 1
        The restitution, its mean, or that at `at_speed`.
    width : float, 0 to 1
        Full width of a uniform distribution.
    at_speed : float, [m/s], > 0
    exponent : float, >= 0
    pairs : tuple of float, 0 to 1
        Of pairs of species: first with first, first with second, ..., second with second, ...; a
        single one holds for all pairs.
    species : int
        Number of species.
    """

    value: float
    width: float = 0.0
    at_speed: float = 1.0
    exponent: float = 0.0
    pairs: tuple[float, ...] = ()
    species: int = 1


def pair_table(terms: LawTerms) -> NDArray[np.float64]:
    """The restitutions of all pairs of species, (n, n).

    Raises
    ------
    SimulationError
        When their number is not that of the pairs.
    """
    n = terms.species
    wanted = n * (n + 1) // 2
    if len(terms.pairs) not in (1, wanted):
        raise SimulationError(
            'restitution_pairs',
            f'{len(terms.pairs)} restitutions for {n} species',
            f'give {wanted}: first with first, first with second, ...; or 1 for all pairs',
        )
    upper = np.triu_indices(n)
    table = np.empty((n, n))
    table[upper] = terms.pairs
    table.T[upper] = table[upper]
    return table


def _viscoelastic(terms: LawTerms) -> ViscoelasticRestitution:
    return ViscoelasticRestitution(value=terms.value, at_speed=terms.at_speed)


def _power(terms: LawTerms) -> PowerLawRestitution:
    return PowerLawRestitution(value=terms.value, at_speed=terms.at_speed, exponent=terms.exponent)


SPEED_LAWS: dict[str, Callable[[LawTerms], SpeedLaw]] = {
    'viscoelastic': _viscoelastic,
    'power': _power,
}
"""Laws by which the restitution depends on the impact speed, of beads and of walls."""
LAWS: dict[str, Callable[[LawTerms], Restitution | NDArray[np.float64]]] = {
    'constant': lambda terms: terms.value,
    'uniform': lambda terms: UniformRestitution(mean=terms.value, width=terms.width),
    **SPEED_LAWS,
    'pairs': pair_table,
}
"""All laws between beads by their names in settings."""


@inlined
def restitution_at(
    kind: int, argument: float, per_speed: float, exponent: float, speed: float
) -> float:
    """Restitution of an impact by `VISCOELASTIC` or `POWER`.

    Parameters
    ----------
    kind : int
    argument, per_speed, exponent : float
        From `compiled_law`.
    speed : float, [m/s]
        Along the normal.
    """
    ratio = (speed * per_speed) ** exponent
    if kind == POWER:
        return max(1.0 - (1.0 - argument) * ratio, 0.0)
    return float(viscoelastic_restitution(argument * ratio))


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


def compiled_law(name: str, law: SpeedLaw) -> tuple[int, float, float, float]:
    """Kind, argument, inverse of the speed and exponent of a law, for `restitution_at`.

    Parameters
    ----------
    name : str
        Rule that has the law, for the error.
    law : ViscoelasticRestitution or PowerLawRestitution

    Raises
    ------
    SimulationError
        For a restitution or exponent outside its range, or a speed that is not positive.
    """
    if not (math.isfinite(law.at_speed) and law.at_speed > 0.0):
        raise SimulationError(name, f'{law!r}', 'give a restitution at a positive speed')
    if isinstance(law, PowerLawRestitution):
        if not (0.0 <= law.value <= 1.0 and 0.0 <= law.exponent < math.inf):
            raise SimulationError(
                name, f'{law!r}', 'give a value from 0 to 1 and an exponent of 0 or more'
            )
        return POWER, law.value, 1.0 / law.at_speed, law.exponent
    if not 0.0 < law.value < 1.0:
        raise SimulationError(name, f'{law!r}', 'give a value between 0 and 1')
    low, high = 0.0, 1.0
    while viscoelastic_restitution(high) > law.value:
        high *= 2.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if viscoelastic_restitution(middle) > law.value else (low, middle)
        )
    return VISCOELASTIC, 0.5 * (low + high), 1.0 / law.at_speed, _VISCOELASTIC_POWER
