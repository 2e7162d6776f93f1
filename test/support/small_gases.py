"""Small gases for the tests."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.experiment.materials import known_materials
from nanorocks_ros.experiment.trays import Species, Tray
from nanorocks_ros.numerics.counter_rng import Purpose, key_for
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.initial_state import resting_beads
from nanorocks_ros.simulation.velocities import uniform_speeds

BOX = (0.015, 0.015, 0.003)


def acrylic(count=15, low=0.002, high=None):
    return Species(
        properties=known_materials()['acrylic'],
        diameter_low=low,
        diameter_high=high or low,
        count=count,
    )


def tray_of(*species, dimensions=BOX):
    return Tray(number=1, dimensions=dimensions, species=species, chalk=False)


def beads_of(positions, velocities, radii=0.001, masses=1e-6):
    n = len(positions)
    return Beads(
        radii=np.broadcast_to(radii, n).astype(float),
        masses=np.broadcast_to(masses, n).astype(float),
        positions=np.array(positions, dtype=float),
        velocities=np.array(velocities, dtype=float),
    )


def shaken(tray, *, seed=1, mean_speed=0.007, **rules):
    """Gas of a tray that has just been shaken."""
    settings = SimulationSettings(seed=seed)
    beads = resting_beads(settings, tray)
    key = key_for(seed, 0, Purpose.VELOCITIES)
    velocities = uniform_speeds(beads.radii.size, mean_speed, key, 0)
    moving = beads_of(beads.positions, velocities, beads.radii, beads.masses)
    return HardSphereGas(moving, CollisionRules(box=tray.dimensions, **rules))


def energy(gas_or_beads, velocities=None):
    """Kinetic energy of beads, or of their masses with other velocities."""
    beads = gas_or_beads.beads() if isinstance(gas_or_beads, HardSphereGas) else gas_or_beads
    v = beads.velocities if velocities is None else velocities
    return 0.5 * np.sum(beads.masses * np.sum(v * v, axis=-1), axis=-1)


def smallest_gap(positions, radii):
    """Smallest distance between the surfaces of two beads, and of a bead and a wall of BOX."""
    i, j = np.triu_indices(len(radii), 1)
    apart = np.linalg.norm(positions[..., i, :] - positions[..., j, :], axis=-1)
    walls = np.minimum(positions, np.array(BOX) - positions) - radii[:, np.newaxis]
    return min(np.min(apart - radii[i] - radii[j]), np.min(walls))
