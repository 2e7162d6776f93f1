"""The beads of a tray before anything happens: drawn sizes, random places, shaken speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.simulation.engine.checks import check_room
from nanorocks_ros.simulation.engine.gas import Beads, CollisionRules
from nanorocks_ros.simulation.ordering import rising
from nanorocks_ros.simulation.randomness import Purpose, direction, hashed, key_for, uniform

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import SimulationSettings
    from nanorocks_ros.experiment.trays import Tray

# Places tried for one bead. Tray 8, the fullest (0.29), needs some hundred for its last ones.
MOST_TRIES = 200_000

_SPHERE = math.pi / 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stock:
    """What the beads of a tray are drawn from, one entry for each bead.

    Parameters
    ----------
    diameter_low, diameter_high : ndarray (n,), [m]
    density : ndarray (n,), [kg/m^3]
    materials : tuple of str
    """

    diameter_low: NDArray[np.float64]
    diameter_high: NDArray[np.float64]
    density: NDArray[np.float64]
    materials: tuple[str, ...]


def stock(tray: Tray) -> Stock:
    """The beads of a tray, species after species.

    Raises
    ------
    SimulationError
        For a tray without beads, or a species that cannot be.
    """
    where = f'tray {tray.number}'
    for one in tray.species:
        sizes = (one.diameter_low, one.diameter_high, one.density)
        usable = all(math.isfinite(size) and size > 0.0 for size in sizes) and one.count >= 0
        if not usable or one.diameter_low > one.diameter_high:
            raise SimulationError(where, f'species {one}', 'give positive sizes, the lower first')
    counts = [one.count for one in tray.species]
    if sum(counts) < 1:
        raise SimulationError(where, 'holds no bead', 'give at least one')
    return Stock(
        diameter_low=np.repeat([one.diameter_low for one in tray.species], counts),
        diameter_high=np.repeat([one.diameter_high for one in tray.species], counts),
        density=np.repeat([one.density for one in tray.species], counts),
        materials=tuple(one.material for one in tray.species for _ in range(one.count)),
    )


def rules_of(settings: SimulationSettings, tray: Tray) -> CollisionRules:
    """The box and the restitutions of a simulated tray."""
    return CollisionRules(
        box=tray.dimensions,
        restitution=settings.restitution,
        wall_restitution=settings.wall_restitution,
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
        When the beads do not fit, or no place is found for one of them.
    """
    drawn = stock(tray)
    rules = rules_of(settings, tray).compiled()
    sizes_key = key_for(settings.seed, run, Purpose.DIAMETERS)
    diameters = draw_diameters(drawn.diameter_low, drawn.diameter_high, sizes_key)
    check_room(0.5 * diameters, rules)
    places_key = key_for(settings.seed, run, Purpose.POSITIONS)
    sides = np.array(tray.dimensions, dtype=np.float64)
    positions, placed = place(0.5 * diameters, sides, places_key, MOST_TRIES)
    if placed < diameters.size:
        raise SimulationError(
            f'tray {tray.number}',
            f'found room for only {placed} of {diameters.size} beads',
            'give fewer or smaller beads',
        )
    return Beads(
        radii=0.5 * diameters,
        masses=sphere_masses(diameters, drawn.density),
        positions=positions,
        velocities=np.zeros((diameters.size, 3)),
    )


@compiled
def draw_diameters(
    low: NDArray[np.float64], high: NDArray[np.float64], key: np.uint64
) -> NDArray[np.float64]:
    """Diameters, even between the two ends of each bead's range, [m]."""
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
def is_free(
    positions: NDArray[np.float64], radii: NDArray[np.float64], order: NDArray[np.int64], last: int
) -> bool:
    """Whether the bead at place `last` of the order overlaps none of those after it."""
    i = order[last]
    for k in range(order.size - 1, last, -1):
        j = order[k]
        square = 0.0
        for axis in range(3):
            d = positions[j, axis] - positions[i, axis]
            square += d * d
        reach = radii[i] + radii[j]
        if square < reach * reach:
            return False
    return True


@compiled
def place(
    radii: NDArray[np.float64], sides: NDArray[np.float64], key: np.uint64, most_tries: int
) -> tuple[NDArray[np.float64], int]:
    """Put beads at random places in a box, the largest first, each clear of those before.

    Parameters
    ----------
    radii : ndarray (n,), [m]
    sides : ndarray (3,), [m]
    key : uint64
    most_tries : int
        For one bead.

    Returns
    -------
    positions : ndarray (n, 3), [m]
    placed : int
        Beads for which there was room; the rest have no valid position.
    """
    n = radii.size
    order = rising(radii)
    positions = np.zeros((n, 3))
    counter = 0
    for k in range(n - 1, -1, -1):
        i = order[k]
        tries = 0
        while True:
            if tries == most_tries:
                return positions, n - 1 - k
            tries += 1
            for axis in range(3):
                free = sides[axis] - 2.0 * radii[i]
                positions[i, axis] = radii[i] + free * uniform(key, counter)
                counter += 1
            if is_free(positions, radii, order, k):
                break
    return positions, n


@compiled
def shaken_velocities(
    n: int, mean_speed: float, key: np.uint64, shake: int
) -> NDArray[np.float64]:
    """Velocities after a shaking event: speeds even in [0, 2 mean), directions even.

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
