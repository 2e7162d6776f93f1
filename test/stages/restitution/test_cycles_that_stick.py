"""Where beads stick, contacts give the restitutions: of free beads, and rebounds of bodies.

``python -m benchmarks stuck_restitution`` measures the same over many cycles.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_collisions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from wall_rebounds import wall_rebounds

from benchmarks.stuck_restitution import stuck_cycle
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.records import (
    NS,
    CorStatus,
    Headline,
    Measured,
    Merge,
    Quality,
    Rebound,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import CoolingSettings, PipelineSettings
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

TRAY = load_trays()[1]
FINAL_ONLY = PipelineSettings(cooling=CoolingSettings(update_interval=60.0))


@pytest.mark.parametrize(('sticking', 'seed'), [(1e-3, 0), (3e-3, 1)])
def test_a_gas_of_bodies_that_turn_shows_both_restitutions(sticking, seed):
    cor, speed = stuck_cycle(1, sticking, seed)
    assert cor.status is CorStatus.FINAL
    assert cor.quality & Quality.STICKING
    assert 0.0 < cor.onset < 5.0
    assert cor.rebounds >= 10
    # Those of free beads are enough.
    assert cor.body_rebounds == 0
    walls, beads = cor.wall_restitution, cor.restitution
    assert walls.lower < 0.97 < walls.upper
    assert walls.upper - walls.lower < 0.02
    assert beads.lower < 0.89 < beads.upper
    assert beads.upper - beads.lower < 0.3
    assert speed.lower < sticking < speed.upper
    assert speed.sticking_speed == pytest.approx(sticking, rel=0.35)


def test_where_all_beads_stick_the_bodies_show_the_walls():
    cor, _ = stuck_cycle(1, 10e-3, 1)
    assert cor.status is CorStatus.UNDETERMINED
    assert cor.headline is Headline.CONTACTS
    assert cor.samples == 0
    assert math.isnan(cor.window_end)
    assert cor.body_rebounds == cor.rebounds >= 5
    assert cor.wall_restitution.lower < 0.97 < cor.wall_restitution.upper
    assert cor.wall_restitution.upper - cor.wall_restitution.lower < 0.07
    assert (cor.restitution.lower, cor.restitution.upper) == (0.0, 1.0)


def test_hits_of_floor_and_lid_that_show_in_no_misfit_are_in_the_errors_of_the_walls():
    """Of 18 rebounds of a body of 15 beads two are off by more than 20 errors of their fits."""
    cor, _ = stuck_cycle(1, 10e-3, 5)
    assert cor.body_rebounds >= 15
    assert cor.wall_restitution.lower < 0.97 < cor.wall_restitution.upper
    assert cor.wall_restitution.upper - cor.wall_restitution.lower < 0.03


def speeds():
    for time in np.arange(0.1, 22.5, 0.1):
        value = haff_speed(time, 6e-3, 5.0)
        yield SpeedEstimate(
            stamp_ns=round(time * NS),
            tray=1,
            cycle=1,
            cycle_start_ns=0,
            mean_projected_speed=Measured(value, 0.02 * value),
            window=0.1,
            method=SpeedMethod.TRACKING,
        )


def merge(time, tracks=(1, 2)):
    return Merge(
        stamp_ns=round(time * NS),
        known_ns=round((time + 0.7) * NS),
        tray=1,
        cycle=1,
        tracks=np.array(tracks, dtype=np.int32),
        joins=True,
    )


def final(*records):
    estimator = RestitutionEstimator(FINAL_ONLY, TRAY)
    ordered = sorted([*speeds(), *records], key=lambda record: record.stamp_ns)
    estimates = [estimate for record in ordered for estimate in estimator.push(record)]
    return [*estimates, *estimator.flush()][-1]


@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(
    number=st.integers(10, 40),
    of_bodies=st.floats(0.0, 1.0),
    onset=st.floats(0.0, 19.0),
    wall=st.floats(0.7, 0.99),
    collisions=st.integers(0, 2),
    seed=st.integers(0, 1000),
)
def test_ten_rebounds_determine_the_walls_whatever_sticks(
    number, of_bodies, onset, wall, collisions, seed
):
    rng = np.random.default_rng(seed)
    rebounds = [
        replace(rebound, beads=2 if rng.uniform() < of_bodies else 1)
        for rebound in wall_rebounds(rng, number, 1.9, 17.0, wall=wall, error=3e-5)
    ]
    met = [
        replace(collision, stamp_ns=round(rng.uniform(2.0, 17.0) * NS), tracks=np.array([5, 6]))
        for collision in drawn_collisions(seed, collisions, 0.89)
    ]
    cor = final(*rebounds, *met, merge(onset))
    free = sum(rebound.beads == 1 for rebound in rebounds)
    assert cor.rebounds == (number if free < 10 else free)
    assert cor.body_rebounds == cor.rebounds - free
    assert math.isfinite(cor.wall_restitution.value)
    assert cor.wall_restitution.lower < cor.wall_restitution.value < cor.wall_restitution.upper
    assert cor.wall_restitution.upper - cor.wall_restitution.lower < 0.1
    assert cor.contact_wall_restitution.value == pytest.approx(wall, abs=0.05)


def test_beads_that_merged_have_no_contacts_of_their_own():
    rng = np.random.default_rng(3)
    rebounds = list(wall_rebounds(rng, 30, 2.0, 17.0))
    of_members = [replace(rebound, track=1) for rebound in wall_rebounds(rng, 20, 9.0, 17.0)]
    before = [replace(rebound, track=1) for rebound in wall_rebounds(rng, 5, 2.0, 7.9)]
    late = replace(merge(8.1), known_ns=19 * NS)
    records = sorted(
        [*speeds(), *rebounds, *of_members, *before, late],
        key=lambda record: getattr(record, 'known_ns', record.stamp_ns),
    )
    estimator = RestitutionEstimator(PipelineSettings(), TRAY)
    estimates = [estimate for record in records for estimate in estimator.push(record)]
    assert max(estimate.rebounds for estimate in estimates) > 50
    assert estimates[-1].rebounds == 35
    assert all(isinstance(contact, Rebound) for contact in rebounds)


def test_a_body_does_not_tell_the_friction_of_the_walls():
    rng = np.random.default_rng(3)
    free = final(*wall_rebounds(rng, 30, 2.0, 17.0), merge(0.3))
    bodies = final(
        *(replace(rebound, beads=3) for rebound in wall_rebounds(rng, 30, 2.0, 17.0)), merge(0.3)
    )
    assert free.wall_friction.known
    assert not bodies.wall_friction.known
    assert bodies.wall_restitution.lower < 0.97 < bodies.wall_restitution.upper


def test_collisions_slower_than_the_sticking_speed_are_allowed_for():
    # Merges tell a sticking speed; collisions above it alone are seen.
    drawn = [
        replace(collision, stamp_ns=stamp_ns, tracks=np.array([5, 6]))
        for collision, stamp_ns in zip(
            drawn_collisions(4, 60, 0.85, sticking_speed=2e-3),
            np.linspace(2.0, 17.0, 60) * NS,
            strict=True,
        )
    ]
    merges = [merge(time, (2 * k, 2 * k + 1)) for k, time in enumerate((0.2, 0.5, 1.1, 2.3))]
    merges = [replace(each, tracks=each.tracks + 10) for each in merges]
    cor = final(*(replace(each, stamp_ns=round(each.stamp_ns)) for each in drawn), *merges)
    assert cor.collisions == 60
    assert cor.contact_restitution.lower < 0.85 < cor.contact_restitution.upper
