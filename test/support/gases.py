"""Gases for the tests of the engine, in natural units: radii and speeds of order 1."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import Kernel
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    UniformRestitution,
    ViscoelasticRestitution,
)
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

BOX = (8.0, 7.0, 6.5)
NEVER = (False, False, False)
ALWAYS = (True, True, True)
KERNELS = [Kernel.SCAN, Kernel.LISTS]

ROUGH = {'tangential_restitution': 0.5, 'wall_tangential_restitution': 0.2}

TRANSLATING = {'aggregate_motion': 'translating'}

# Every kind of rule, alone and combined, but for bodies that turn.
RULES = {
    'elastic': {},
    'inelastic': {'restitution': 0.8, 'wall_restitution': (0.9, 0.8, 0.7, 0.6, 0.95, 0.85)},
    'periodic': {'periodic': ALWAYS, 'restitution': 0.9},
    'half periodic': {
        'periodic': (True, True, False),
        'restitution': 0.9,
        'wall_restitution': 0.9,
    },
    'species': {'restitution': [[0.9, 0.7], [0.7, 0.5]], 'wall_restitution': 0.9},
    'random': {
        'restitution': UniformRestitution(mean=0.7, width=0.4),
        'wall_restitution': 0.9,
        'seed': 5,
    },
    'viscoelastic': {'restitution': ViscoelasticRestitution(value=0.8, at_speed=1.0)},
    'sticking': {
        'restitution': 0.8,
        'sticking_speed': 0.2,
        'wall_restitution': 0.9,
        **TRANSLATING,
    },
    'sticking, total speed': {
        'restitution': 0.8,
        'sticking_speed': 0.8,
        'sticking_measure': 'total',
        'wall_restitution': 0.9,
        **TRANSLATING,
    },
    'sticking, periodic': {
        'periodic': ALWAYS,
        'restitution': 0.9,
        'sticking_speed': 0.3,
        **TRANSLATING,
    },
    'sticking to walls': {
        'restitution': 0.9,
        'sticking_speed': 0.15,
        'wall_sticking_speed': 0.15,
        'wall_restitution': 0.95,
        **TRANSLATING,
    },
    'rough': {'restitution': 0.9, 'wall_restitution': 0.9, **ROUGH},
    'rough and sliding': {
        'restitution': 0.9,
        'wall_restitution': 0.9,
        'friction': 0.2,
        'wall_friction': 0.1,
        **ROUGH,
    },
    'rough and sticking': {
        'restitution': 0.95,
        'sticking_speed': 0.2,
        'wall_sticking_speed': 0.15,
        **ROUGH,
        **TRANSLATING,
    },
    'contact duration': {
        'restitution': 0.3,
        'wall_restitution': 0.3,
        'contact_duration': 0.3,
    },
    'contact duration, rough': {
        'restitution': 0.4,
        'wall_restitution': 0.4,
        'contact_duration': 0.5,
        **ROUGH,
    },
    'shaken': {
        'restitution': 0.9,
        'wall_restitution': 0.9,
        'motion': WallMotion.sinusoidal((0.3, 0.2, 0.0), 0.8, periods=4, start=0.5),
    },
    'struck and rough': {
        'restitution': 0.9,
        'wall_restitution': 0.9,
        'motion': WallMotion.impulsive((2.0, 0.0, 1.0), 0.8, damping=1.0, start=0.5),
        **ROUGH,
    },
}

# Bodies that turn.
TURNING = {
    'turning': {'restitution': 0.8, 'sticking_speed': 0.4, 'wall_restitution': 0.9},
    'turning, random threshold': {
        'restitution': UniformRestitution(mean=0.7, width=0.4),
        'sticking_speed': 0.4,
        'sticking_speed_width': 0.8,
        'sticking_measure': 'total',
        'seed': 5,
    },
    'turning and stopping': {
        'restitution': 0.9,
        'sticking_speed': 0.3,
        'wall_sticking_speed': 0.1,
        'wall_restitution': 0.95,
    },
    'turning and shaken': {
        'restitution': 0.9,
        'sticking_speed': 0.3,
        'wall_restitution': 0.9,
        'motion': WallMotion.sinusoidal((0.3, 0.2, 0.0), 0.8, periods=4, start=0.5),
    },
}
BREAKING = {
    'turning and breaking': {
        'restitution': 0.9,
        'sticking_speed': 0.5,
        'break_up_speed': 0.8,
        'wall_restitution': 0.95,
    },
}
ALL_RULES = RULES | TURNING | BREAKING


def near(value, tolerance=1e-12):
    return pytest.approx(value, rel=tolerance, abs=tolerance)


def beads_of(positions, velocities, *, radii=1.0, masses=1.0, **more):
    n = len(positions)
    return Beads(
        radii=np.broadcast_to(radii, n).astype(float),
        masses=np.broadcast_to(masses, n).astype(float),
        positions=np.array(positions, dtype=float),
        velocities=np.array(velocities, dtype=float),
        **more,
    )


def gas_of(positions, velocities, *, kernel=Kernel.AUTOMATIC, box=(10.0, 10.0, 10.0), **more):
    """A gas of a few beads; what is not of the beads is of the rules."""
    of_beads = {'radii', 'masses', 'spins', 'species', 'drag'}
    beads = beads_of(positions, velocities, **{k: more[k] for k in of_beads & more.keys()})
    rules = {name: value for name, value in more.items() if name not in of_beads}
    return HardSphereGas(beads, CollisionRules(box=box, **rules), kernel)


def to_nearest(differences, box, periodic):
    """Differences of coordinates, (..., 3), to the nearest images."""
    box = np.array(box)
    return differences - np.where(periodic, box * np.rint(differences / box), 0.0)


def placed(random, radii, box, periodic=NEVER):
    """Random places, beads neither overlapping nor in a wall."""
    inset = np.where(periodic, 0.0, radii[:, np.newaxis])
    places = np.empty((len(radii), 3))
    for i in range(len(radii)):
        while True:
            places[i] = random.uniform(inset[i], np.array(box) - inset[i])
            apart = to_nearest(places[:i] - places[i], box, periodic)
            if np.all(np.linalg.norm(apart, axis=1) > radii[:i] + radii[i]):
                break
    return places


def mixture(seed, n, rules, sizes=(0.6, 1.0)):
    """Beads of different sizes and densities, in the box of the rules, with random velocities."""
    random = np.random.default_rng(seed)
    radii = random.uniform(*sizes, n)
    table = not isinstance(rules.restitution, UniformRestitution | ViscoelasticRestitution)
    rough = rules.tangential_restitution is not None
    return Beads(
        radii=radii,
        masses=radii**3 * random.uniform(0.5, 2.0, n),
        positions=placed(random, radii, rules.box, rules.periodic),
        velocities=random.normal(size=(n, 3)),
        spins=random.normal(size=(n, 3)) if rough else None,
        species=random.integers(0, 2, n) if table and np.ndim(rules.restitution) else None,
    )


def smallest_gap(positions, radii, rules):
    """Smallest distance between two surfaces, or a surface and a wall at rest, in any frame."""
    i, j = np.triu_indices(len(radii), 1)
    apart = to_nearest(positions[..., j, :] - positions[..., i, :], rules.box, rules.periodic)
    gaps = np.linalg.norm(apart, axis=-1) - radii[i] - radii[j]
    walls = np.minimum(positions, np.array(rules.box) - positions) - radii[:, np.newaxis]
    walls = np.where(rules.periodic, np.inf, walls)
    return min(gaps.min(initial=np.inf), walls.min())


def energy(beads, velocities=None, spins=None):
    """Kinetic energy of beads, or with the velocities and spins of frames (..., n, 3)."""
    v = beads.velocities if velocities is None else velocities
    w = beads.spins if velocities is None else spins
    total = 0.5 * np.sum(beads.masses * np.sum(v * v, axis=-1), axis=-1)
    if w is not None:
        inertias = 0.4 * beads.masses * beads.radii**2
        total = total + 0.5 * np.sum(inertias * np.sum(w * w, axis=-1), axis=-1)
    return total


def momentum(beads):
    return beads.masses @ beads.velocities


def angular_momentum(beads):
    """About the origin."""
    total = np.cross(beads.positions, beads.masses[:, np.newaxis] * beads.velocities).sum(axis=0)
    if beads.spins is not None:
        total += (0.4 * beads.masses * beads.radii**2) @ beads.spins
    return total
