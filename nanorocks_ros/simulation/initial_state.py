"""Initial state of a tray: drawn sizes, random positions, velocities after shaking."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.counter_rng import Purpose, key_for, uniform
from nanorocks_ros.physics.stokes_drag import stokes_rate, viscosity_of
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.input_checks import check_room
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import LAWS, SPEED_LAWS, LawTerms
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion
from nanorocks_ros.simulation.packing.random_placement import random_positions
from nanorocks_ros.simulation.velocities import maxwellian, uniform_speeds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.simulation.engine.rules.restitution_laws import Restitution, SpeedLaw

_SPHERE = math.pi / 6.0
_SMOOTH = -1.0
_CONSTANT, _UNIFORM = 'constant', 'uniform'
# Largest speed of the walls of a shaken tray, in mean speeds of the beads.
_WALL_SPEED = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Inventory:
    """Ranges from which the beads of a tray are drawn, one entry for each bead.

    Parameters
    ----------
    diameter_low, diameter_high : ndarray (n,), [m]
    density : ndarray (n,), [kg/m^3]
    materials : tuple of str
    species : ndarray of int32, (n,)
        Index of the species in the list of the tray.
    """

    diameter_low: NDArray[np.float64]
    diameter_high: NDArray[np.float64]
    density: NDArray[np.float64]
    materials: tuple[str, ...]
    species: NDArray[np.int32]


def inventory(tray: Tray) -> Inventory:
    """The beads of a tray, species after species.

    Raises
    ------
    SimulationError
        For a tray without beads, or an invalid species.
    """
    place = f'tray {tray.number}'
    for species in tray.species:
        sizes = (species.diameter_low, species.diameter_high, species.density)
        usable = all(math.isfinite(size) and size > 0.0 for size in sizes) and species.count >= 0
        if not usable or species.diameter_low > species.diameter_high:
            raise SimulationError(
                place, f'species {species}', 'give positive sizes, the lower first'
            )
    counts = [species.count for species in tray.species]
    if sum(counts) < 1:
        raise SimulationError(place, 'holds no bead', 'give at least one')
    return Inventory(
        diameter_low=np.repeat([species.diameter_low for species in tray.species], counts),
        diameter_high=np.repeat([species.diameter_high for species in tray.species], counts),
        density=np.repeat([species.density for species in tray.species], counts),
        materials=tuple(
            species.material for species in tray.species for _ in range(species.count)
        ),
        species=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
    )


def rules_of(settings: SimulationSettings, tray: Tray, run: int = 0) -> CollisionRules:
    """Rules of collisions of a simulated tray.

    Raises
    ------
    SimulationError
        For a range of restitutions outside 0 to 1, or a table of pairs of other species.
    """
    tangential: tuple[float | None, float | None] = (
        settings.tangential_restitution,
        settings.wall_tangential_restitution,
    )
    if max(settings.tangential_restitution, settings.wall_tangential_restitution) <= _SMOOTH:
        tangential = None, None
    return CollisionRules(
        box=tray.dimensions,
        restitution=_beads(settings, tray),
        wall_restitution=_walls(settings),
        sticking_speed=settings.sticking_speed,
        wall_sticking_speed=settings.wall_sticking_speed,
        sticking_measure=settings.sticking_measure,
        sticking_speed_width=settings.sticking_speed_width,
        aggregate_motion=settings.aggregate_motion,
        break_up_speed=settings.break_up_speed,
        tangential_restitution=tangential[0],
        wall_tangential_restitution=tangential[1],
        friction=settings.friction,
        wall_friction=settings.wall_friction,
        seed=settings.seed,
        run=run,
    )


def _beads(settings: SimulationSettings, tray: Tray) -> Restitution | NDArray[np.float64]:
    """Restitution of two beads.

    Raises
    ------
    SimulationError
        For a width with a law that has none, or a table of other species.
    """
    name = settings.restitution_law
    if settings.restitution_width > 0.0 and name == _CONSTANT:
        name = _UNIFORM
    elif settings.restitution_width > 0.0 and name != _UNIFORM:
        raise SimulationError(
            'restitution_law',
            f'{name!r} with a restitution_width of {settings.restitution_width:g}',
            'set one of them',
        )
    return LAWS[name](_terms(settings, settings.restitution, len(tray.species)))


def _walls(settings: SimulationSettings) -> Sequence[float] | Sequence[SpeedLaw]:
    """Restitution of the side walls, two for each axis, and of floor and lid."""
    side = settings.wall_restitution
    ends = min(max(side + settings.floor_lid_difference, 0.0), 1.0)
    values = (side, side, side, side, ends, ends)
    if settings.wall_restitution_law == _CONSTANT:
        return values
    law = SPEED_LAWS[settings.wall_restitution_law]
    return [law(_terms(settings, value)) for value in values]


def _terms(settings: SimulationSettings, value: float, species: int = 1) -> LawTerms:
    return LawTerms(
        value=value,
        width=settings.restitution_width,
        at_speed=settings.restitution_speed,
        exponent=settings.restitution_exponent,
        pairs=settings.restitution_pairs,
        species=species,
    )


def wall_motion(settings: SimulationSettings) -> WallMotion:
    """Motion of the walls of a shaken tray: sinusoidal along its diagonal."""
    amplitude = _WALL_SPEED * settings.mean_speed / (2.0 * math.pi * settings.shake_frequency)
    along = amplitude / math.sqrt(3.0)
    return WallMotion.sinusoidal(
        (along, along, along), settings.shake_frequency, settings.shake_periods
    )


def resting_beads(settings: SimulationSettings, tray: Tray, run: int = 0) -> Beads:
    """The beads of a tray at rest, at random places.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    run : int, >= 0
        Runs of one seed differ.

    Raises
    ------
    SimulationError
        When the beads do not fit.
    """
    drawn = inventory(tray)
    rules = rules_of(settings, tray).compiled()
    sizes_key = key_for(settings.seed, run, Purpose.DIAMETERS)
    diameters = draw_diameters(drawn.diameter_low, drawn.diameter_high, sizes_key)
    check_room(0.5 * diameters, rules)
    places_key = key_for(settings.seed, run, Purpose.POSITIONS)
    positions = random_positions(0.5 * diameters, tray.dimensions, key=places_key)
    rates = np.zeros(diameters.size)
    set_drag(rates, diameters, drawn.density, gas_viscosity(settings, tray))
    return Beads(
        radii=0.5 * diameters,
        masses=sphere_masses(diameters, drawn.density),
        positions=positions,
        velocities=np.zeros((diameters.size, 3)),
        species=drawn.species,
        drag=rates if settings.drag > 0.0 else None,
    )


def gas_viscosity(settings: SimulationSettings, tray: Tray) -> float:
    """Viscosity of a gas that drags the first species of a tray as set, [Pa s]."""
    first = tray.species[0]
    return viscosity_of(settings.drag, first.density, first.diameter)


@compiled
def set_drag(
    rates: NDArray[np.float64],
    diameters: NDArray[np.float64],
    density: NDArray[np.float64],
    viscosity: float,
) -> None:
    """Set the rates at which a gas slows spheres, [1/s].

    Parameters
    ----------
    rates : ndarray (n,) or (n, columns) or (0,)
        Written; equal columns.
    diameters, density : ndarray (n,), [m], [kg/m^3]
    viscosity : float, [Pa s]
    """
    columns = rates.size // diameters.size
    for k in range(rates.size):
        i = k // columns
        rates.flat[k] = stokes_rate(viscosity, density[i], diameters[i])


@compiled
def draw_diameters(
    low: NDArray[np.float64], high: NDArray[np.float64], key: np.uint64
) -> NDArray[np.float64]:
    """Diameters, uniform in the range of each bead, [m]."""
    diameters = np.empty(low.size)
    for i in range(low.size):
        diameters[i] = low[i] + (high[i] - low[i]) * uniform(key, i)
    return diameters


@compiled
def sphere_masses(
    diameters: NDArray[np.float64], density: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Masses of spheres, [kg]."""
    masses = np.empty(diameters.size)
    for i in range(diameters.size):
        masses[i] = density[i] * _SPHERE * diameters[i] * diameters[i] * diameters[i]
    return masses


@compiled
def draw_velocities(
    masses: NDArray[np.float64],
    mean_speed: float,
    maxwell: bool,
    vertical: float,
    key: np.uint64,
    shake: int,
) -> NDArray[np.float64]:
    """Velocities after a shaking event, (n, 3), [m/s]; walls give all masses the same speeds.

    `vertical` is a factor on the velocities along z.
    """
    if maxwell:
        velocities = maxwellian(masses, mean_speed, key, shake, False)
    else:
        velocities = uniform_speeds(masses.size, mean_speed, key, shake)
    for i in range(masses.size):
        velocities[i, 2] *= vertical
    return velocities
