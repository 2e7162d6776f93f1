"""What happens in a collision, and the box that it happens in."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.counter_rng import Purpose, key_for
from nanorocks_ros.simulation.engine.restitution_laws import (
    CONSTANT,
    UNIFORM,
    VISCOELASTIC,
    viscoelastic,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

# Hertz contact of two 2 mm acrylic beads that meet at 10 mm/s lasts about this long.
CONTACT_DURATION = 4e-5

_NOT_STICKING = 0.0
_SMOOTH = -1.0
# Sides to a box, and walls to an axis.
_SIDES, _WALLS = 3, 6


STICKING_MEASURES = 'normal', 'total'


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformRestitution:
    """A restitution drawn anew at each collision, even in mean ± width / 2.

    Parameters
    ----------
    mean : float, 0 to 1
    width : float, >= 0
        Full width; the whole range must lie within 0 to 1.
    """

    mean: float
    width: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ViscoelasticRestitution:
    """A restitution that falls with the impact speed as that of viscoelastic spheres.

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
class WallMotion:
    """How the tray moves, all walls together: amplitude exp(-damping t) sin(frequency t).

    Parameters
    ----------
    amplitude : tuple of 3 floats, [m]
    angular_frequency : float, [rad/s], > 0
    damping : float, [1/s], >= 0
    start, end : float, [s]
        The tray is at rest, and in its place, before and after.
    """

    amplitude: tuple[float, float, float]
    angular_frequency: float
    damping: float = 0.0
    start: float = 0.0
    end: float = math.inf

    @classmethod
    def sinusoidal(
        cls,
        amplitude: tuple[float, float, float],
        frequency: float,
        periods: int,
        start: float = 0.0,
    ) -> WallMotion:
        """Shaking to and fro for some periods, at a frequency in Hz.

        Raises
        ------
        SimulationError
            For a frequency that is not above 0.
        """
        _check_frequency(frequency)
        return cls(
            amplitude=amplitude,
            angular_frequency=2.0 * math.pi * frequency,
            start=start,
            end=start + periods / frequency,
        )

    @classmethod
    def impulsive(
        cls,
        velocity: tuple[float, float, float],
        frequency: float,
        damping: float,
        start: float = 0.0,
    ) -> WallMotion:
        """A blow that gives the tray a velocity [m/s]; it swings on its springs and comes to rest.

        The swing ends after a whole number of periods, once it has shrunk to a millionth.

        Raises
        ------
        SimulationError
            For a frequency that is not above 0.
        """
        _check_frequency(frequency)
        omega = 2.0 * math.pi * frequency
        periods = math.ceil(math.log(1e6) / damping * frequency) if damping > 0.0 else math.inf
        x, y, z = velocity
        return cls(
            amplitude=(x / omega, y / omega, z / omega),
            angular_frequency=omega,
            damping=damping,
            start=start,
            end=start + periods / frequency,
        )


Restitution = float | UniformRestitution | ViscoelasticRestitution


class Rules(NamedTuple):
    """The same for compiled code; see `CollisionRules`."""

    sides: tuple[float, float, float]
    per_side: tuple[float, float, float]
    periodic: tuple[bool, bool, bool]
    kind: int
    restitution: NDArray[np.float64]
    first: float
    second: float
    seed_key: np.uint64
    wall_restitution: tuple[float, float, float, float, float, float]
    contact_duration: float
    sticky: bool
    sticking_speed: float
    wall_sticking_speed: float
    total_measure: bool
    rough: bool
    tangential: float
    wall_tangential: float
    friction: float
    wall_friction: float
    moving: bool
    amplitude: tuple[float, float, float]
    angular_frequency: float
    damping: float
    start: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionRules:
    """The box, and what a collision leaves of the velocities.

    Parameters
    ----------
    box : tuple of 3 floats, [m], > 0
        Sides; a corner is the origin.
    periodic : tuple of 3 bools
        Axes without walls, on which the box repeats itself.
    restitution : float, or (n_species, n_species) array, or a law, 0 to 1
        Of the normal relative velocity of two beads: constant, by species, drawn at random or
        falling with speed.
    wall_restitution : float or 6 floats, 0 to 1
        Low and high wall of x, y and z.
    contact_duration : float, [s], >= 0
        A contact is elastic when the last one of the same two beads (or of the same bead and
        wall) was less than this ago; without it, inelastic collapse piles up events without
        end.
    sticking_speed : float, [m/s], >= 0
        Bodies that meet more slowly merge into a rigid body that does not rotate.
    wall_sticking_speed : float, [m/s], >= 0
        Bodies that meet a wall more slowly stay there.
    sticking_measure : 'normal' or 'total'
        The speed compared: along the normal of the contact, or the whole relative velocity.
    tangential_restitution, wall_tangential_restitution : float or None, -1 to 1
        Of rough spheres, which rotate: of the tangential velocity of the surfaces at the
        contact; -1 is smooth, 1 perfectly rough. None: beads have no spin; for the walls:
        smooth.
    friction, wall_friction : float, >= 0
        Of rough spheres, Coulomb's: where the tangential impulse would be larger than this times
        the normal one, surfaces slide, and it is as large. Infinite: nothing slides.
    motion : WallMotion or None
    seed, run : int, >= 0
        Of a restitution drawn at random; runs of one seed differ.
    allow_gain : bool
        Accept restitutions above 1, which feed energy in at every collision.

    Raises
    ------
    SimulationError
        For a value that cannot be used.

    References
    ----------
    Luding, McNamara 1998, Granular Matter 1, 113 (contact duration); Jenkins, Richman 1985,
    Phys. Fluids 28, 3485 (rough spheres).
    """

    box: tuple[float, float, float]
    periodic: tuple[bool, bool, bool] = (False, False, False)
    restitution: Restitution | Sequence[Sequence[float]] | NDArray[np.float64] = 1.0
    wall_restitution: float | Sequence[float] = 1.0
    contact_duration: float = CONTACT_DURATION
    sticking_speed: float = _NOT_STICKING
    wall_sticking_speed: float = _NOT_STICKING
    sticking_measure: str = 'normal'
    tangential_restitution: float | None = None
    wall_tangential_restitution: float | None = None
    friction: float = math.inf
    wall_friction: float = math.inf
    motion: WallMotion | None = None
    seed: int = 0
    run: int = 0
    allow_gain: bool = False

    def __post_init__(self) -> None:
        self.compiled()

    @property
    def species(self) -> int:
        """How many species the restitution tells apart; 1 when it does not."""
        law = self.restitution
        if isinstance(law, UniformRestitution | ViscoelasticRestitution):
            return 1
        return int(np.atleast_2d(np.asarray(law, dtype=np.float64)).shape[0])

    def compiled(self) -> Rules:
        """The same for compiled code.

        Raises
        ------
        SimulationError
            For a value that cannot be used.
        """
        self._check_sticking()
        kind, table, first, second = self._law()
        sides = _sides(self.box)
        motion = self.motion or WallMotion(amplitude=(0.0, 0.0, 0.0), angular_frequency=1.0)
        if self.motion is not None:
            _check_motion(motion)
        return Rules(
            sides=sides,
            per_side=(1.0 / sides[0], 1.0 / sides[1], 1.0 / sides[2]),
            periodic=_flags(self.periodic),
            kind=kind,
            restitution=table,
            first=first,
            second=second,
            seed_key=key_for(self.seed, self.run, Purpose.RESTITUTION),
            wall_restitution=self._walls(),
            contact_duration=_at_least_zero('contact_duration', self.contact_duration, 's'),
            sticky=self.sticking_speed > 0.0 or self.wall_sticking_speed > 0.0,
            sticking_speed=float(self.sticking_speed),
            wall_sticking_speed=float(self.wall_sticking_speed),
            total_measure=self.sticking_measure == 'total',
            rough=self.tangential_restitution is not None
            or self.wall_tangential_restitution is not None,
            tangential=_tangential('tangential_restitution', self.tangential_restitution),
            wall_tangential=_tangential(
                'wall_tangential_restitution', self.wall_tangential_restitution
            ),
            friction=_friction('friction', self.friction),
            wall_friction=_friction('wall_friction', self.wall_friction),
            moving=self.motion is not None,
            amplitude=_three(motion.amplitude),
            angular_frequency=float(motion.angular_frequency),
            damping=float(motion.damping),
            start=float(motion.start),
            end=float(motion.end),
        )

    def _check_sticking(self) -> None:
        _at_least_zero('sticking_speed', self.sticking_speed, 'm/s')
        _at_least_zero('wall_sticking_speed', self.wall_sticking_speed, 'm/s')
        if self.sticking_measure not in STICKING_MEASURES:
            raise SimulationError(
                'sticking_measure',
                f'{self.sticking_measure!r} is none of {", ".join(STICKING_MEASURES)}',
                'give one of them',
            )
        if self.wall_sticking_speed > 0.0 and self.motion is not None:
            raise SimulationError(
                'wall_sticking_speed',
                'bodies cannot stick to walls that move',
                'let the tray be at rest, or set it to 0',
            )

    def _law(self) -> tuple[int, NDArray[np.float64], float, float]:
        law = self.restitution
        none = np.zeros((1, 1))
        if isinstance(law, UniformRestitution):
            low, high = law.mean - 0.5 * law.width, law.mean + 0.5 * law.width
            highest = sys.float_info.max if self.allow_gain else 1.0
            if not (law.width >= 0.0 and low >= 0.0 and high <= highest):
                raise SimulationError(
                    'restitution',
                    f'{law!r} reaches from {low:.6g} to {high:.6g}',
                    'keep mean ± width / 2 within 0 to 1',
                )
            return UNIFORM, none, float(law.mean), float(law.width)
        if isinstance(law, ViscoelasticRestitution):
            return VISCOELASTIC, none, *_viscoelastic_scale(law)
        table = np.atleast_2d(_numbers('restitution', law, self.allow_gain))
        if table.ndim != 2 or table.shape[0] != table.shape[1] or np.any(table != table.T):
            raise SimulationError(
                'restitution',
                f'not a symmetric table, shape {table.shape}',
                'give one row and one column for each species',
            )
        return CONSTANT, table, 0.0, 0.0

    def _walls(self) -> tuple[float, float, float, float, float, float]:
        given = _numbers('wall_restitution', self.wall_restitution, self.allow_gain)
        if given.shape not in ((), (_WALLS,)):
            raise SimulationError(
                'wall_restitution', f'shape {given.shape}', f'give one value or {_WALLS}'
            )
        a, b, c, d, e, f = np.broadcast_to(given, _WALLS).tolist()
        return a, b, c, d, e, f


def for_species(table: NDArray[np.float64], n_species: int) -> NDArray[np.float64]:
    """The table of restitutions for so many species; one value holds for all of them."""
    if table.shape[0] >= n_species:
        return table
    return np.full((n_species, n_species), table[0, 0])


def _three(numbers: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = (float(number) for number in numbers)
    return x, y, z


def _sides(box: Sequence[float]) -> tuple[float, float, float]:
    if len(box) != _SIDES:
        raise SimulationError('box', f'{len(box)} sides', 'give three, in metres')
    for name, side in zip('xyz', box, strict=True):
        if not (math.isfinite(side) and side > 0.0):
            raise SimulationError(
                'box', f'side_{name} is {side!r}', 'give positive sides in metres'
            )
    return _three(box)


def _flags(periodic: Sequence[bool]) -> tuple[bool, bool, bool]:
    if len(periodic) != _SIDES:
        raise SimulationError('periodic', f'{len(periodic)} axes', 'give three truth values')
    x, y, z = (bool(one) for one in periodic)
    return x, y, z


def _numbers(name: str, values: ArrayLike, allow_gain: bool) -> NDArray[np.float64]:
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SimulationError(name, f'{values!r}', 'give numbers from 0 to 1') from error
    for value in numbers.ravel().tolist():
        if not (0.0 <= value <= 1.0 or (allow_gain and math.isfinite(value) and value > 1.0)):
            raise SimulationError(
                name,
                f'{value!r} is outside [0, 1]',
                'give a value from 0 to 1, or above 1 with allow_gain=True',
            )
    return numbers


def _at_least_zero(name: str, value: float, unit: str) -> float:
    if not (math.isfinite(value) and value >= 0.0):
        raise SimulationError(name, f'{value!r}', f'give 0 or a positive number, in {unit}')
    return float(value)


def _tangential(name: str, value: float | None) -> float:
    if value is None:
        return _SMOOTH
    if not -1.0 <= value <= 1.0:
        raise SimulationError(name, f'{value!r} is outside [-1, 1]', 'give a value from -1 to 1')
    return float(value)


def _friction(name: str, value: float) -> float:
    if not value >= 0.0:
        raise SimulationError(name, f'{value!r}', 'give 0 or more')
    return float(value)


def _check_frequency(frequency: float) -> None:
    if not (math.isfinite(frequency) and frequency > 0.0):
        raise SimulationError('motion', f'frequency {frequency!r}', 'give one above 0, in Hz')


def _check_motion(motion: WallMotion) -> None:
    numbers = (*motion.amplitude, motion.damping, motion.start)
    usable = (
        len(motion.amplitude) == _SIDES
        and all(math.isfinite(number) for number in numbers)
        and math.isfinite(motion.angular_frequency)
        and motion.angular_frequency > 0.0
        and motion.damping >= 0.0
        and motion.end >= motion.start
    )
    if not usable:
        raise SimulationError(
            'motion', f'{motion!r}', 'give finite amplitudes, a positive frequency, start <= end'
        )


def _viscoelastic_scale(law: ViscoelasticRestitution) -> tuple[float, float]:
    """The argument of the Padé form at the given speed, and the inverse of that speed."""
    if not (0.0 < law.value < 1.0 and math.isfinite(law.at_speed) and law.at_speed > 0.0):
        raise SimulationError(
            'restitution', f'{law!r}', 'give a value between 0 and 1 at a positive speed'
        )
    low, high = 0.0, 1.0
    while viscoelastic(high) > law.value:
        high *= 2.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if viscoelastic(middle) > law.value else (low, middle)
    return 0.5 * (low + high), 1.0 / law.at_speed
