"""Speeds, body counts and merges of a cycle, simulated from kinetic theory."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import (
    BodyEstimate,
    Measured,
    Merge,
    SpeedEstimate,
    SpeedMethod,
)

NS = 1_000_000_000
TRAY = load_trays()[1]
STICKING = 1.5e-3


def ns(time):
    return round(time * NS)


def speed(time, value, cycle, start):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=cycle,
        cycle_start_ns=round(start * NS),
        mean_projected_speed=Measured(value, 0.02 * value),
        window=0.1,
        method=SpeedMethod.TRACKING,
    )


def count(time, bodies, cycle):
    return BodyEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=cycle,
        beads=TRAY.count,
        followed=TRAY.count,
        bodies=Measured(bodies, 0.1),
        mean_size=Measured(TRAY.count / bodies, 0.1),
        weighted_size=Measured(TRAY.count / bodies, 0.1),
        clustered_share=Measured(0.0, 0.0),
        clusters=Measured(0.0, 0.0),
        sizes=np.zeros(5),
    )


def cooling(cycle=1, start=0.0, seed=0, sticking=STICKING, until=40.0):
    """Records of a cycle in which bodies merge at the rate of kinetic theory."""
    rng = np.random.default_rng([seed, cycle])
    contacts = slow_contacts(TRAY)
    bodies, records, step = float(TRAY.count), [], 0.1
    for time in np.arange(step, until, step):
        value = float(haff_speed(time, 8e-3, 4.0))
        rate = 0.5 * bodies**2 / TRAY.count * value * float(contacts.rate_below(sticking / value))
        if bodies > 1.0 and rng.uniform() < rate * step:
            bodies -= 1.0
            records.append(merge(start + time, cycle))
        records += [speed(start + time, value, cycle, start), count(start + time, bodies, cycle)]
    return records


def merge(time, cycle, known=0.6):
    return Merge(
        stamp_ns=round(time * NS),
        known_ns=round((time + known) * NS),
        tray=1,
        cycle=cycle,
        tracks=np.array([1, 2], dtype=np.int32),
        joins=True,
    )
