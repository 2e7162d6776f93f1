"""Rules of collisions: box, restitutions, sticking, friction and motion of the walls."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.counter_rng import Purpose, key_for
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    CONSTANT,
    UNIFORM,
    PowerLawRestitution,
    Restitution,
    SpeedLaw,
    UniformRestitution,
    ViscoelasticRestitution,
    compiled_law,
)
from nanorocks_ros.simulation.engine.rules.rule_checks import (
    checked_axes,
    checked_box,
    checked_friction,
    checked_non_negative,
    checked_restitutions,
    checked_tangential,
    three_floats,
)
from nanorocks_ros.simulation.engine.rules.sticking_rules import StickingRules
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion, check_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Hertz contact of two 2 mm acrylic beads that meet at 10 mm/s lasts about this long.
CONTACT_DURATION = 4e-5

_WALLS = 6
_OfWalls = tuple[float, float, float, float, float, float]


class Rules(NamedTuple):
    """`CollisionRules` for compiled code."""

    sides: tuple[float, float, float]
    per_side: tuple[float, float, float]
    periodic: tuple[bool, bool, bool]
    kind: int
    restitution: NDArray[np.float64]
    first: float
    second: float
    exponent: float
    seed_key: np.uint64
    wall_kind: int
    wall_restitution: _OfWalls
    wall_per_speed: float
    wall_exponent: float
    contact_duration: float
    sticky: bool
    sticking_speed: float
    sticking_width: float
    sticking_key: np.uint64
    wall_sticking_speed: float
    total_measure: bool
    rotating: bool
    break_up_speed: float
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
class CollisionRules(StickingRules):
    """The box and the outcome of collisions.

    Parameters
    ----------
    sticking_speed and others
        See `StickingRules`.
    box : tuple of 3 floats, [m], > 0
        Sides; a corner is the origin.
    periodic : tuple of 3 bools
        Axes without walls, on which the box repeats itself.
    restitution : float, or (n_species, n_species) array, or a law, 0 to 1
        Of the normal relative velocity of two beads: constant, by species, drawn at random or
        falling with speed.
    wall_restitution : float or a law that falls with speed, or 6 of them, 0 to 1
        Low and high wall of x, y and z. Laws may differ in their value alone.
    contact_duration : float, [s], >= 0
        A contact is elastic when the last one of the same two beads (or of the same bead and
        wall) was less than this ago; without it, inelastic collapse leads to events without
        end.
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
        For an invalid value.

    References
    ----------
    Luding, McNamara 1998, Granular Matter 1, 113 (contact duration; there for each particle,
    here for each pair); Jenkins, Richman 1985,
    Phys. Fluids 28, 3485 (rough spheres).
    """

    box: tuple[float, float, float]
    periodic: tuple[bool, bool, bool] = (False, False, False)
    restitution: Restitution | Sequence[Sequence[float]] | NDArray[np.float64] = 1.0
    wall_restitution: float | SpeedLaw | Sequence[float] | Sequence[SpeedLaw] = 1.0
    contact_duration: float = CONTACT_DURATION
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
        """Number of species in the table of restitutions; 1 for a law or a single value."""
        law = self.restitution
        if isinstance(law, UniformRestitution | ViscoelasticRestitution | PowerLawRestitution):
            return 1
        return int(np.atleast_2d(np.asarray(law, dtype=np.float64)).shape[0])

    def compiled(self) -> Rules:
        """The rules as compiled code takes them.

        Raises
        ------
        SimulationError
            For an invalid value.
        """
        rough = (
            self.tangential_restitution is not None or self.wall_tangential_restitution is not None
        )
        self.check_sticking(
            moving=self.motion is not None, rough=rough, periodic=any(self.periodic)
        )
        kind, table, first, second, exponent = self._law()
        wall_kind, walls, wall_per_speed, wall_exponent = self._walls()
        sides = checked_box(self.box)
        motion = self.motion or WallMotion(amplitude=(0.0, 0.0, 0.0), angular_frequency=1.0)
        if self.motion is not None:
            check_motion(motion)
        return Rules(
            sides=sides,
            per_side=(1.0 / sides[0], 1.0 / sides[1], 1.0 / sides[2]),
            periodic=checked_axes(self.periodic),
            kind=kind,
            restitution=table,
            first=first,
            second=second,
            exponent=exponent,
            seed_key=key_for(self.seed, self.run, Purpose.RESTITUTION),
            wall_kind=wall_kind,
            wall_restitution=walls,
            wall_per_speed=wall_per_speed,
            wall_exponent=wall_exponent,
            contact_duration=checked_non_negative('contact_duration', self.contact_duration, 's'),
            sticky=self.sticking_speed > 0.0 or self.wall_sticking_speed > 0.0,
            sticking_speed=float(self.sticking_speed),
            sticking_width=float(self.sticking_speed_width),
            sticking_key=key_for(self.seed, self.run, Purpose.STICKING),
            wall_sticking_speed=float(self.wall_sticking_speed),
            total_measure=self.sticking_measure == 'total',
            rotating=self.forms_turning_bodies,
            break_up_speed=float(self.break_up_speed),
            rough=rough,
            tangential=checked_tangential('tangential_restitution', self.tangential_restitution),
            wall_tangential=checked_tangential(
                'wall_tangential_restitution', self.wall_tangential_restitution
            ),
            friction=checked_friction('friction', self.friction),
            wall_friction=checked_friction('wall_friction', self.wall_friction),
            moving=self.motion is not None,
            amplitude=three_floats(motion.amplitude),
            angular_frequency=float(motion.angular_frequency),
            damping=float(motion.damping),
            start=float(motion.start),
            end=float(motion.end),
        )

    def _law(self) -> tuple[int, NDArray[np.float64], float, float, float]:
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
            return UNIFORM, none, float(law.mean), float(law.width), 0.0
        if isinstance(law, ViscoelasticRestitution | PowerLawRestitution):
            kind, argument, per_speed, exponent = compiled_law('restitution', law)
            return kind, none, argument, per_speed, exponent
        table = np.atleast_2d(checked_restitutions('restitution', law, self.allow_gain))
        if table.ndim != 2 or table.shape[0] != table.shape[1] or np.any(table != table.T):
            raise SimulationError(
                'restitution',
                f'not a symmetric table, shape {table.shape}',
                'give one row and one column for each species',
            )
        return CONSTANT, table, 0.0, 0.0, 0.0

    def _walls(self) -> tuple[int, _OfWalls, float, float]:
        """Kind, restitution or argument of each wall, inverse of the speed, and exponent."""
        given: Any = self.wall_restitution
        laws = _speed_laws(given)
        if laws:
            kinds, arguments, per_speeds, exponents = zip(
                *(compiled_law('wall_restitution', law) for law in laws), strict=True
            )
            if len({*zip(kinds, per_speeds, exponents, strict=True)}) > 1:
                raise SimulationError(
                    'wall_restitution', f'{given!r}', 'give walls laws that differ in their value'
                )
            return kinds[0], _of_walls(np.array(arguments)), per_speeds[0], exponents[0]
        restitutions = checked_restitutions('wall_restitution', given, self.allow_gain)
        return CONSTANT, _of_walls(restitutions), 0.0, 0.0


def _speed_laws(walls: object) -> list[SpeedLaw]:
    """The laws of walls that are all given by one; empty where none is."""
    given = list(walls) if isinstance(walls, list | tuple) else [walls]
    laws = [law for law in given if isinstance(law, ViscoelasticRestitution | PowerLawRestitution)]
    if laws and len(laws) < len(given):
        raise SimulationError('wall_restitution', f'{walls!r}', 'give all walls a law, or none')
    return laws


def _of_walls(values: NDArray[np.float64]) -> _OfWalls:
    """One value for all walls, or one each."""
    if values.shape not in ((), (1,), (_WALLS,)):
        raise SimulationError(
            'wall_restitution', f'shape {values.shape}', f'give one value or {_WALLS}'
        )
    a, b, c, d, e, f = np.broadcast_to(values, _WALLS).tolist()
    return a, b, c, d, e, f


def restitution_table(table: NDArray[np.float64], n_species: int) -> NDArray[np.float64]:
    """Table of restitutions for `n_species`; a single value holds for all pairs."""
    if table.shape[0] >= n_species:
        return table
    return np.full((n_species, n_species), table[0, 0])
