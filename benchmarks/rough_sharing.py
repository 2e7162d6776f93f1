"""Cooling gases of rough beads: energy of translation and rotation by direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.hard_sphere_runs import DIAMETER, MASS, TIME, bulk
from benchmarks.rough_gas import settings_of
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.rough_spheres import SOLID_SPHERE
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking

BULK_DENSITY = 0.1


def bulk_course(restitution, tangential, seeds, duration=600.0):
    """Collisions per bead and temperature ratio in a periodic box, started without rotation."""
    rows = []
    for seed in seeds:
        gas = bulk(
            5,
            BULK_DENSITY,
            seed,
            restitution=restitution,
            tangential_restitution=tangential,
        )
        times = np.linspace(0.0, duration, 61) * TIME
        record = gas.follow(times[-1], times, times)
        inertia = SOLID_SPHERE * MASS * (0.5 * DIAMETER) ** 2
        rotation = inertia * np.mean(record.spins**2, axis=(1, 2))
        translation = MASS * np.mean(record.velocities**2, axis=(1, 2))
        collisions = 2.0 * record.observations.pair_collisions / gas.radii.size
        rows.append((collisions, rotation, translation))
    collisions, rotation, translation = np.mean(rows, axis=0)
    return collisions, rotation / translation


@dataclass(frozen=True, slots=True, kw_only=True)
class Sharing:
    """Mean energies by direction and axis over beads and runs, (n_species, n_times, 3), [J].

    Parameters
    ----------
    flight, spin : ndarray
        Twice the energy: m v^2 and I w^2 along x, y and z.
    """

    flight: np.ndarray
    spin: np.ndarray

    @property
    def ratio(self):
        """Temperature of the rotation over that of the translation, (n_species, n_times)."""
        return self.spin.mean(axis=2) / self.flight.mean(axis=2)

    @property
    def upright_flight(self):
        """Mean square of velocity along z over that along x and y, (n_species, n_times)."""
        return self.flight[..., 2] / self.flight[..., :2].mean(axis=2)

    @property
    def upright_spin(self):
        """Share of the energy of rotation about z; 1/3 for isotropic rotation."""
        total = self.spin.sum(axis=2)
        return self.spin[..., 2] / np.where(total > 0.0, total, np.nan)


def sharing(number, roughness, times, runs, **values):
    """Energies in a tray at some times since the shaking."""
    tray = load_trays()[number]
    settings = settings_of(tray, roughness, **values)
    flight, spin = [], []
    for run in range(runs):
        rules = rules_of(settings, tray, run)
        resting = resting_beads(settings, tray, run)
        beads = after_shaking(settings, rules, resting, run, 0)
        record = HardSphereGas(beads, rules).follow(times[-1], times)
        mass = resting.masses[:, np.newaxis]
        inertia = SOLID_SPHERE * mass * resting.radii[:, np.newaxis] ** 2
        masks = [beads.species == k for k in range(len(tray.species))]
        for totals, energies in (
            (flight, mass * record.velocities**2),
            (spin, inertia * record.spins**2),
        ):
            totals.append([energies[:, mask].mean(axis=1) for mask in masks])
    return Sharing(flight=np.mean(flight, axis=0), spin=np.mean(spin, axis=0))


def single_collisions(restitution, roughness, ratio, n=400_000, seed=1):
    """Ratio of relative speeds after and before single collisions, (n,), weighted by their rate.

    Parameters
    ----------
    restitution : float
    roughness : Roughness
    ratio : float
        Temperature of the rotation over that of the translation.
    """
    random = np.random.default_rng(seed)
    # Normal speeds follow Rayleigh's law, since fast beads meet more often; kT = m = r = 1.
    normal = math.sqrt(2.0) * random.rayleigh(size=n)
    across = math.sqrt(2.0) * random.normal(size=(n, 2))
    turning = math.sqrt(2.0 * ratio / SOLID_SPHERE) * random.normal(size=(n, 2))
    slip = across + turning
    size = np.hypot(*slip.T)
    # Per unit of reduced mass, 1/2.
    mass = SOLID_SPHERE / (1.0 + SOLID_SPHERE)
    grip = mass * (1.0 + roughness.tangential) * size
    slide = roughness.friction * (1.0 + restitution) * normal
    push = np.minimum(grip, slide) / size
    after = across - push[:, np.newaxis] * slip
    before = np.sqrt(normal**2 + (across**2).sum(axis=1))
    return np.sqrt((restitution * normal) ** 2 + (after**2).sum(axis=1)) / before
