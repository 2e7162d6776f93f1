"""Rules and small gases for the tests of the reference engine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from .gas import ReferenceGas

NEVER = (False, False, False)
ALWAYS = (True, True, True)


@dataclass(frozen=True)
class Rules:
    box: tuple[float, float, float] = (10.0, 10.0, 10.0)
    periodic: tuple[bool, bool, bool] = NEVER
    restitution: Any = 1.0
    wall_restitution: Any = 1.0
    contact_duration: float = 0.0
    sticking_speed: float = 0.0
    sticking_measure: str = 'normal'
    wall_sticking_speed: float = 0.0
    tangential_restitution: float | None = None
    wall_tangential_restitution: float | None = None
    friction: float = math.inf
    wall_friction: float = math.inf
    motion: Any = None
    seed: int = 1


@dataclass(frozen=True)
class Motion:
    amplitude: tuple[float, float, float]
    angular_frequency: float
    damping: float = 0.0
    start: float = 0.0
    end: float = math.inf


@dataclass(frozen=True)
class Uniform:
    mean: float
    width: float


@dataclass(frozen=True)
class Viscoelastic:
    value: float
    at_speed: float


def gas_of(positions, velocities, *, radii=1.0, masses=1.0, rules=None, **state):
    n = len(positions)
    return ReferenceGas(
        np.broadcast_to(radii, n).astype(float),
        np.broadcast_to(masses, n).astype(float),
        np.array(positions, dtype=float),
        np.array(velocities, dtype=float),
        rules or Rules(),
        **state,
    )


def near(value):
    return pytest.approx(value, rel=1e-12, abs=1e-12)


def angular_momentum(gas):
    beads = gas.beads
    orbital = np.cross(gas.positions, beads.masses[:, None] * gas.velocities)
    return (orbital + beads.inertias[:, None] * gas.spins).sum(axis=0)


def energy(gas):
    return gas.beads.energy(*range(len(gas.body)))


def momentum(gas):
    return gas.beads.masses @ gas.velocities
