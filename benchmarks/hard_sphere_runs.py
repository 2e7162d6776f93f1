"""Single runs of the event-driven engine that measure known quantities of hard spheres.

Beads have the size, mass and speed of those of tray 1; results are in the units of `hard_spheres`.
A run starts on a lattice, which melts before the measurement; runs of different seeds are
independent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.hard_spheres import collision_rate, contact_value, few_beads_ratio, pressure
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

DIAMETER = 0.002
MASS = 4.94e-6
SPEED = 0.01
# d / v.
TIME = DIAMETER / SPEED

_FCC = np.array([[0.25, 0.25, 0.25], [0.75, 0.75, 0.25], [0.75, 0.25, 0.75], [0.25, 0.75, 0.75]])
_PERIODIC = (True, True, True)
# In d / v; at a density of 0.5 these are 46 and 92 mean free times.
LAGS = (6, 12)
# Distance from a wall beyond which density layers are negligible at densities up to 0.3, [d].
_LAYERS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Mean over independent runs, and its standard error."""

    mean: float
    error: float

    def scaled(self, factor):
        """The value and its error, times a factor."""
        return Measured(mean=self.mean * factor, error=self.error * abs(factor))


def over_runs(measure, seeds):
    """Mean and standard error of a measured value over runs with different seeds."""
    values = np.array([measure(seed) for seed in seeds])
    return Measured(
        mean=float(values.mean()), error=float(values.std(ddof=1) / math.sqrt(values.size))
    )


def lattice(cells, sides):
    """Places of a face-centred cubic lattice, (n, 3), in a box."""
    corners = np.stack(np.meshgrid(*(np.arange(cell) for cell in cells), indexing='ij'), axis=-1)
    places = (corners.reshape(-1, 1, 3) + _FCC).reshape(-1, 3)
    return places / np.array(cells) * np.array(sides)


def thermal_velocities(masses, seed):
    """Maxwell-distributed velocities with zero total momentum and energy exactly kT = m v^2."""
    velocities = np.random.default_rng(seed).normal(size=(masses.size, 3))
    velocities /= np.sqrt(masses)[:, np.newaxis]
    velocities -= masses @ velocities / masses.sum()
    energy = np.sum(masses[:, np.newaxis] * velocities**2) / (3 * masses.size - 3)
    return velocities * SPEED * math.sqrt(MASS / energy)


def equal_gas(positions, seed, **rules):
    """A thermal gas of equal beads."""
    masses = np.full(len(positions), MASS)
    beads = Beads(
        radii=np.full(len(positions), 0.5 * DIAMETER),
        masses=masses,
        positions=positions,
        velocities=thermal_velocities(masses, seed),
    )
    return HardSphereGas(beads, CollisionRules(**rules))


def bulk(cells, density, seed, **rules):
    """A gas of 4 cells^3 equal beads in a periodic cube."""
    side = DIAMETER * cells * (4.0 / density) ** (1.0 / 3.0)
    box = (side, side, side)
    return equal_gas(lattice((cells,) * 3, box), seed, box=box, periodic=_PERIODIC, **rules)


def collision_rate_ratio(cells, density, seed, *, settle=40.0, collisions=240.0):
    """Collision rate over Enskog's for a finite number of beads; `collisions` are per bead."""
    gas = bulk(cells, density, seed)
    n = gas.radii.size
    rate = collision_rate(density) / TIME
    times = settle / rate, (settle + collisions) / rate
    observed = gas.follow(times[-1], (), times).observations
    counted = 2.0 * np.diff(observed.pair_collisions)[0] / n
    return counted / collisions / few_beads_ratio(density, n)


def virial_pressure_ratio(cells, density, seed, *, settle=40.0, collisions=240.0):
    """Excess pressure over the ideal gas, from logged impulses, relative to that of [CS]."""
    gas = bulk(cells, density, seed)
    rate = collision_rate(density) / TIME
    gas.follow(settle / rate)
    events = gas.follow((settle + collisions) / rate, log=True).events
    n = gas.radii.size
    virial = DIAMETER * events['impulse'].sum() * rate / collisions / (3.0 * n)
    excess = virial / (MASS * SPEED**2)
    return excess / (pressure(density) / density - 1.0)


def diffusion(cells, density, seed, *, settle=10.0, duration=120.0):
    """Self-diffusion, in d v: the slope of the mean squared displacement between two lags."""
    gas = bulk(cells, density, seed)
    times = (settle + np.arange(duration)) * TIME
    positions = gas.follow(times[-1], times).positions / DIAMETER
    squares = [3.0 * np.mean((positions[lag:] - positions[:-lag]) ** 2) for lag in LAGS]
    return (squares[1] - squares[0]) / (LAGS[1] - LAGS[0]) / 6.0


def cooling_coefficient(cells, density, restitution, seed, *, settle=15.0, haff_times=2.0):
    """C of Haff's law, see `haff_coefficient`, from the slope of 1 / <v> over time.

    The slope is the same whenever it is measured, so the gas may cool while the lattice melts.
    """
    gas = bulk(cells, density, seed, restitution=restitution, contact_duration=0.0)
    loss = 1.0 - restitution**2
    rate = collision_rate(density) / TIME
    times = (settle + np.linspace(0.0, haff_times * 6.0 / loss, 61)) / rate
    observed = gas.follow(times[-1], (), times).observations
    slope = np.polyfit(times, 1.0 / observed.mean_speed, 1)[0]
    cross_section, number_density = math.pi * DIAMETER**2, density / DIAMETER**3
    return slope / (loss * cross_section * number_density * contact_value(density))


def wall_pressure_ratio(cells, density, seed, *, settle=20.0, duration=200.0):
    """Pressure on two walls over that of [CS] at the bulk density between them.

    Beads form layers at the walls; the bulk density is counted outside these layers.
    """
    sides = DIAMETER * (4.0 / density) ** (1.0 / 3.0) * np.array(cells)
    gas = equal_gas(lattice(cells, sides), seed, box=tuple(sides), periodic=(False, True, True))
    n = gas.radii.size
    times = (settle + np.arange(duration)) * TIME
    record = gas.follow(times[-1], times, times[[0, -1]])
    impulse = np.abs(np.diff(record.observations.wall_impulse, axis=0)[0, :2]).mean()
    measured = impulse / (sides[1] * sides[2] * (times[-1] - times[0]))
    # Momentum towards the walls is not conserved: 3n - 2 directions share the energy.
    energy = MASS * SPEED**2 * (3 * n - 3) / (3 * n - 2)
    side = sides[0] / DIAMETER
    off_centre = np.abs(record.positions[:, :, 0] / DIAMETER - 0.5 * side)
    inside = float(np.mean(off_centre < 0.5 * side - _LAYERS))
    bulk_density = density * inside * side / (side - 2.0 * _LAYERS)
    return measured * DIAMETER**3 / energy / pressure(bulk_density)


def mixture_temperature_ratio(seed, *, settle=60.0, duration=300.0):
    """Temperature of heavy, large beads over that of light beads, which start with all the energy.

    The total momentum is zero, which reduces the energy of a bead by its share of the mass.
    """
    side = 12.0 * DIAMETER
    places = lattice((4, 4, 4), (side, side, side))
    species = np.repeat(np.array([0, 1], dtype=np.int32), len(places) // 2)
    species = np.random.default_rng(seed).permutation(species)
    large = species == 1
    masses = np.where(large, 8.0, 1.0) * MASS
    velocities = np.zeros(places.shape)
    velocities[~large] = thermal_velocities(masses[~large], seed)
    beads = Beads(
        radii=np.where(large, 1.0, 0.5) * DIAMETER,
        masses=masses,
        positions=places,
        velocities=velocities,
        species=species,
    )
    gas = HardSphereGas(beads, CollisionRules(box=(side, side, side), periodic=_PERIODIC))
    times = np.arange(settle, settle + duration, 0.5) * TIME
    observed = gas.follow(times[-1], (), times).observations
    squares = observed.granular_temperature.mean(axis=(0, 2))
    share = 1.0 - np.array([1.0, 8.0]) * MASS / masses.sum()
    return (8.0 * squares[1] / share[1]) / (squares[0] / share[0])


def rough_temperature_ratio(seed, *, settle=60.0, duration=300.0):
    """Temperature of rotation over that of translation, which starts with all the energy.

    Perfectly rough, elastic spheres; 3n degrees of freedom of rotation, 3n - 3 of translation.
    """
    gas = bulk(4, 0.3, seed, tangential_restitution=1.0)
    times = np.arange(settle, settle + duration, 0.5) * TIME
    record = gas.follow(times[-1], times)
    n = gas.radii.size
    inertia = 0.4 * MASS * (0.5 * DIAMETER) ** 2
    translation = MASS * np.mean(record.velocities**2) * 3 * n / (3 * n - 3)
    return inertia * np.mean(record.spins**2) / translation


def shaken_tray(seed, *, restitution=0.89, frequency=5.0, duration=120.0):
    """Energies [J] of the 15 beads of tray 1 at whole periods of the shaking, (n_periods + 1,).

    Beads lose energy in their collisions; the walls are elastic, and add energy by their motion.

    Returns
    -------
    energy, lost_to_beads, gained_at_walls : ndarray
        Kinetic energy, and sums since the start.
    """
    count, box = 15, (0.015, 0.015, 0.003)
    places = (np.indices((4, 4)).reshape(2, -1).T[:count] + 0.5) * box[0] / 4.0
    gas = equal_gas(
        np.column_stack((places, np.full(count, 0.5 * box[2]))),
        seed,
        box=box,
        restitution=restitution,
        motion=WallMotion(
            amplitude=(1e-3, 0.7e-3, 0.3e-3), angular_frequency=math.tau * frequency
        ),
    )
    times = np.arange(round(duration * frequency) + 1) / frequency
    observed = gas.follow(times[-1], (), times).observations
    squares = observed.granular_temperature[:, 0].sum(axis=1)
    lost = observed.energy_lost
    return 0.5 * count * MASS * squares, lost[:, 0], -lost[:, 1]
