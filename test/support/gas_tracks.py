"""Simulated gases, tracked with the errors of a tracker, and what happened in them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from benchmarks.contacts import tracks_of
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray

RATE = 30.0


class TrackedGas(NamedTuple):
    """One run: tracks of cycle 1, collisions of pairs so far and bodies at each frame."""

    tray: object
    tracks: list
    pairs: np.ndarray
    bodies: np.ndarray


@lru_cache(maxsize=32)
def tracked_gas(number, run, *, seconds=40.0, restitution=0.89, sticking_speed=0.0, seed=5):
    """A tray shaken at time 0; velocities of the tracks are the true ones."""
    tray = load_trays()[number]
    settings = SimulationSettings(
        restitution=restitution,
        wall_restitution=0.97,
        sticking_speed=sticking_speed,
        seed=seed,
        first_shake=0.0,
        frame_rate=RATE,
    )
    gas = ShakenTray(settings, tray, run)
    tracks, pairs, bodies = [], [], []
    rng = np.random.default_rng([seed, run])
    for record in tracks_of(gas, tray, rng, round(seconds * RATE)):
        tracks.append(replace(record, cycle=1))
        pairs.append(gas.counts.pair)
        bodies.append(np.unique(gas.bodies).size)
    return TrackedGas(tray, tracks, np.array(pairs), np.array(bodies))


def with_beads_lost(tracks, share, seed=0):
    """The tracks without a share of the beads of every frame, and each lost for itself."""
    rng = np.random.default_rng(seed)
    kept = []
    for record in tracks:
        rows = rng.random(record.ids.size) >= share
        names = 'ids', 'species', 'positions', 'position_errors', 'velocities'
        names += 'velocity_errors', 'radii', 'radius_errors', 'seen'
        kept.append(replace(record, **{name: getattr(record, name)[rows] for name in names}))
    return kept
