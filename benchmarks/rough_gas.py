"""Cooling gases of rough beads: temperatures of rotation, and what one reads of their decays.

Restitutions 0.89 (beads) and 0.97 (walls) unless said otherwise, started at 10 mm/s without
rotation. A roughness is the tangential restitution of beads, and that of walls.
"""

from __future__ import annotations

import math
from functools import partial, reduce
from operator import add

import numpy as np

from benchmarks.contacts import contacts_of, true_tracks
from benchmarks.hard_sphere_runs import DIAMETER, MASS, TIME, bulk
from nanorocks_ros.experiment.settings import PriorSettings, SimulationSettings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contact_terms import ContactTerms
from nanorocks_ros.inference.decay_library import library_of
from nanorocks_ros.inference.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.restitution import posterior_of, tables_of
from nanorocks_ros.physics.confined import confined_gas
from nanorocks_ros.physics.instantaneous import instantaneous_cor
from nanorocks_ros.physics.paper import (
    RELATIVE_TO_MEAN_SPEED,
    paper_instantaneous_restitution,
)
from nanorocks_ros.physics.rotation import SOLID_SPHERE
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.simulation.initial import resting_beads, rules_of
from nanorocks_ros.simulation.shaking import after_shaking

PAIRS, WALLS = 0.89, 0.97
SMOOTH = (-1.0, -1.0)
# Walls rough like the beads, and walls that are smooth.
ROUGH = ((-0.5, -0.5), (0.0, 0.0), (0.5, 0.5), (0.5, -1.0))
BULK_DENSITY = 0.1
_FIRST, _LAST, _RATE, _ERROR = 1.75, 20.0, 30.0, 0.02
_NS = 1e9


def named(roughness):
    """How a table calls it."""
    beads, walls = roughness
    if beads <= -1.0:
        return 'smooth'
    return f'{beads:g}, walls ' + ('smooth' if walls <= -1.0 else f'{walls:g}')


def settings_of(tray, roughness, **values):
    """Of a simulated tray."""
    return SimulationSettings(
        **{
            'tray': tray.number,
            'restitution': PAIRS,
            'wall_restitution': WALLS,
            'tangential_restitution': roughness[0],
            'wall_tangential_restitution': roughness[1],
            'mean_speed': 0.010,
            'seed': 99,
            'first_shake': 0.0,
            'frame_rate': _RATE,
            **values,
        }
    )


def bulk_course(restitution, tangential, seeds, duration=300.0):
    """Collisions of each bead, and rotation over translation, in a periodic box, from no spin."""
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
        course = gas.follow(times[-1], times, times)
        inertia = SOLID_SPHERE * MASS * (0.5 * DIAMETER) ** 2
        rotation = inertia * np.mean(course.spins**2, axis=(1, 2))
        translation = MASS * np.mean(course.velocities**2, axis=(1, 2))
        collisions = 2.0 * course.observations.pair_collisions / gas.radii.size
        rows.append((collisions, rotation, translation))
    collisions, rotation, translation = np.mean(rows, axis=0)
    return collisions, rotation / translation


def tray_ratios(number, roughness, times, runs, **values):
    """Rotation over translation of each species in a tray, (n_times, n_species)."""
    tray = load_trays()[number]
    settings = settings_of(tray, roughness, **values)
    rotation, translation = [], []
    for run in range(runs):
        rules = rules_of(settings, tray, run)
        resting = resting_beads(settings, tray, run)
        beads = after_shaking(settings, rules, resting, run, 0)
        course = HardSphereGas(beads, rules).follow(times[-1], times)
        spins = (course.spins**2).mean(axis=2) * SOLID_SPHERE * resting.radii**2
        speeds = (course.velocities**2).mean(axis=2)
        own = [beads.species == k for k in range(len(tray.species))]
        mass = resting.masses
        rotation.append([(mass * spins)[:, one].mean(axis=1) for one in own])
        translation.append([(mass * speeds)[:, one].mean(axis=1) for one in own])
    return (np.mean(rotation, axis=0) / np.mean(translation, axis=0)).T


def speeds_of(number, roughness, times, runs, **values):
    """Mean projected speeds of a tray, (n_runs, n_times), [m/s]."""
    tray = load_trays()[number]
    settings = settings_of(tray, roughness, **values)
    return cooling_runs(settings, tray, times, range(runs)).mean_projected_speed


def paper_values(speeds, step, tray):
    """The paper's estimate and the speed it stands at, of curves (n_curves, n_times).

    From speeds 1 s apart; the collision speed is that of the mean over all curves, so that
    noise moves no value from one speed to another.
    """
    lag = round(1.0 / step)
    found = paper_instantaneous_restitution(
        speeds[:, :-lag], speeds[:, lag:], lag * step, tray.diameter, tray.number_density
    )
    return found, RELATIVE_TO_MEAN_SPEED * speeds.mean(axis=0)[:-lag]


def widths(values, speed, edges):
    """Half widths of the middle 68 % of the estimates about their median, by speed, and those > 1.

    Parameters
    ----------
    values : ndarray (n_curves, n_times)
    speed : ndarray (n_times,)
    edges : sequence of float
        Of the ranges of speed, [m/s].

    Returns
    -------
    half, above_one, highest : ndarray (n_ranges,)
        NaN where no speed is in the range; `highest` is the 97.5 % quantile.
    """
    rows = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = values[:, (speed >= low) & (speed < high)]
        if inside.size:
            ends = np.nanquantile(inside, (0.16, 0.84, 0.975))
            rows.append((0.5 * (ends[1] - ends[0]), np.nanmean(inside > 1.0), ends[2]))
        else:
            rows.append((math.nan,) * 3)
    return np.array(rows).T


def local_values(speeds, times, tray, error):
    """Our local restitutions of one curve after another, with their errors: (n_curves, 3, n).

    Speed [m/s], restitution, half of its 68 % interval.
    """
    gas = confined_gas(tray)
    found = []
    for one in speeds:
        local = instantaneous_cor(
            (times, one, np.full(times.size, error)),
            tray,
            gas,
            wall_restitution=WALLS,
            windows=4,
        ).local
        found.append((local.speed, local.restitution, 0.5 * (local.upper - local.lower)))
    return np.array(found)


def read_cycles(number, roughness, cycles):
    """What decays, contacts and both say of the cycles of a tray, beads taken for smooth.

    Returns
    -------
    dict
        Posterior by 'decay, walls known', 'decay', 'all'; 'rebounds' and 'collisions' in a cycle.
    """
    tray = load_trays()[number]
    settings = settings_of(tray, roughness)
    library = library_of(tray)
    times = np.arange(_FIRST, _LAST, 0.1)
    noise = np.random.default_rng([number, cycles]).standard_normal((cycles, times.size))
    speeds = cooling_runs(settings, tray, times, range(cycles)).mean_projected_speed
    speeds = speeds * np.exp(_ERROR * noise)
    found = {}
    prior = PriorSettings()
    camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)
    tables = tables_of(library, tray, prior)
    decays = [decay_likelihood(tables, times, one, _ERROR * one, camera) for one in speeds]
    decay = reduce(add, decays).integrated()
    contacts = reduce(
        add, (_contacts(tray, settings, run) for run in range(cycles)), ContactTerms.of(())
    )
    read = partial(posterior_of, tables, decay)
    walls = (prior.wall_low, prior.wall_high)
    found['decay, walls known'] = read((WALLS, WALLS))
    found['decay'] = read(walls)
    found['all'] = read(
        walls,
        of_beads=contacts.of_beads(prior.collision_bias),
        of_walls=contacts.of_walls(prior.rebound_bias),
    )
    counts = contacts.rebounds / cycles, contacts.collisions / cycles
    return found, contacts, counts


def _contacts(tray, settings, run):
    tracks = true_tracks(tray, settings, run, round(_LAST * _RATE))
    found = contacts_of(tray, tracks)
    return ContactTerms.of([one for one in found if one.stamp_ns > _FIRST * _NS])
