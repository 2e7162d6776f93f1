"""Contacts found in tracks, against the events of a gas that is followed exactly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, bounced, tracks_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import PairCollision, Rebound
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder

TRAY = load_trays()[1]
PAIRS, WALLS = 0.85, 0.93
TIMES = np.arange(36) / RATE


def _found(tracks, tray=TRAY):
    finder = ContactFinder(tray)
    found = [one for record in tracks for one in finder.push(record)]
    return [*found, *finder.flush()]


@pytest.fixture(scope='module')
def gas():
    """A cooling tray: its events, and what is found in its tracks."""
    settings = SimulationSettings(
        restitution=PAIRS, wall_restitution=WALLS, seed=4, mean_speed=0.006
    )
    rules = rules_of(settings, TRAY)
    beads = after_shaking(settings, rules, resting_beads(settings, TRAY), 0, 0)
    times = np.arange(900) / RATE
    course = HardSphereGas(beads, rules).follow(times[-1], times, log=True)
    planar = course.positions[:, :, :2]
    tracks = tracks_of(planar, velocities=course.velocities[:, :, :2], jitter=0.02 * PIXEL)
    return course.events, _found(tracks)


def _events(events, kind, time):
    near = np.abs(events['time'] - time) < 0.5 / RATE
    return events[near & (events['kind'] == kind)]


def test_every_rebound_found_is_a_collision_with_that_wall(gas):
    events, found = gas
    rebounds = [one for one in found if isinstance(one, Rebound)]
    assert len(rebounds) > 15
    for rebound in rebounds:
        hits = _events(events, 'wall', rebound.stamp_ns / 1e9)
        hit = hits[(hits['bead'] == rebound.track) & (hits['partner'] == rebound.wall)]
        assert hit.size == 1
        assert rebound.incoming == pytest.approx(
            hit['normal_speed'][0], abs=5.0 * rebound.incoming_error
        )


def test_rebounds_return_the_restitution_of_the_wall_within_their_errors(gas):
    rebounds = [one for one in gas[1] if isinstance(one, Rebound)]
    errors = np.array(
        [math.hypot(rebound.outgoing_error, rebound.incoming_error) for rebound in rebounds]
    )
    misses = np.array([rebound.outgoing - WALLS * rebound.incoming for rebound in rebounds])
    assert np.median(np.abs(misses / errors)) < 1.0
    assert np.median(
        [rebound.outgoing / rebound.incoming for rebound in rebounds]
    ) == pytest.approx(WALLS, abs=0.01)


def test_every_collision_found_is_one_of_those_two_beads(gas):
    events, found = gas
    pairs = [one for one in found if isinstance(one, PairCollision)]
    assert len(pairs) > 15
    wrong = 0
    for pair in pairs:
        hits = _events(events, 'pair', pair.stamp_ns / 1e9)
        names = np.sort(np.column_stack([hits['bead'], hits['partner']]), axis=1)
        wrong += not (names == np.sort(pair.tracks)).all(axis=1).any()
    assert wrong <= 1


def test_collisions_keep_the_momentum_and_part_along_the_line_of_centres(gas):
    for one in gas[1]:
        if isinstance(one, PairCollision):
            lost = np.abs((one.after - one.before).sum(axis=0)).max()
            assert lost < 6.0 * np.hypot(one.before_errors, one.after_errors).max()
            assert np.hypot(*one.separation) == pytest.approx(2e-3, rel=0.11)
            assert (one.after[1] - one.after[0]) @ one.separation > (
                one.before[1] - one.before[0]
            ) @ one.separation


def test_the_same_tracks_give_the_same_contacts_again_after_going_back():
    tracks = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    finder = ContactFinder(TRAY)
    first = [one for record in tracks for one in finder.push(record)] + list(finder.flush())
    again = [one for record in tracks for one in finder.push(record)] + list(finder.flush())
    assert len(first) == 1
    assert [one.outgoing for one in again] == [first[0].outgoing]


def test_flush_gives_a_rebound_that_the_end_of_the_tracks_follows():
    # The bead touches the wall at frame 12; four places after it make the second flight.
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))[:17]
    finder = ContactFinder(TRAY)
    assert [contact for record in records for contact in finder.push(record)] == []
    (rebound,) = finder.flush()
    assert isinstance(rebound, Rebound)
    assert rebound.stamp_ns == pytest.approx(0.4e9, abs=0.01e9)
    assert rebound.outgoing / rebound.incoming == pytest.approx(0.9, abs=0.03)
    assert finder.flush() == ()


def test_flush_gives_a_collision_that_the_end_of_the_tracks_follows():
    records = list(tracks_of(_collision(0.0), jitter=0.02 * PIXEL))[:19]
    finder = ContactFinder(TRAY)
    assert [contact for record in records for contact in finder.push(record)] == []
    (collision,) = finder.flush()
    assert isinstance(collision, PairCollision)
    assert sorted(collision.tracks.tolist()) == [0, 1]
    assert collision.stamp_ns == pytest.approx(0.4e9, abs=0.01e9)


def test_tracks_that_go_on_after_a_flush_begin_new_flights():
    times = np.arange(90) / RATE
    positions = bounced(times, 3e-3, 0.9, at=2.0)
    records = list(tracks_of(positions, jitter=0.02 * PIXEL))
    finder = ContactFinder(TRAY)
    contacts = [contact for record in records[:30] for contact in finder.push(record)]
    contacts += finder.flush()
    assert contacts == []
    contacts = [contact for record in records[30:] for contact in finder.push(record)]
    (rebound,) = [*contacts, *finder.flush()]
    assert rebound.stamp_ns == pytest.approx(2.0e9, abs=0.01e9)


def test_reset_forgets_contacts_that_are_held_back():
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    finder = ContactFinder(TRAY)
    for record in records:
        finder.push(record)
    finder.reset()
    assert finder.flush() == ()
    assert len([contact for record in records for contact in finder.push(record)]) == 0
    assert len(finder.flush()) == 1


def test_a_rebound_is_measured_past_the_wall_that_swings():
    omega = 2.0 * math.pi * 1.5

    def wall(time):
        return 1.5e-4 * np.sin(omega * time)

    times = np.arange(90) / RATE
    swing = np.column_stack([wall(times), np.zeros(times.size)])
    for at in (1.25, 1.5, 1.7):
        ways = bounced(times, 3e-3, 0.9, at=at, along=1e-3, wall=wall)
        near = (times > at - 0.4) & (times < at + 0.4)
        records = list(tracks_of(ways, displacements=swing, jitter=0.01 * PIXEL))
        hidden = [
            record if shown else replace(record, seen=np.zeros(1, dtype=bool))
            for record, shown in zip(records, near, strict=True)
        ]
        (found,) = _found(hidden)
        assert found.wall == 0
        true = -1.5e-4 * omega * np.cos(omega * at)
        assert found.wall_velocity == pytest.approx(true, abs=3e-5)
        assert found.outgoing / found.incoming == pytest.approx(0.9, abs=0.02)


def test_a_bead_that_is_hidden_at_the_wall_gives_no_rebound():
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    assert len(_found(records)) == 1
    records[12] = replace(records[12], seen=np.zeros(1, dtype=bool))
    assert _found(records) == []


def test_a_bead_that_is_hidden_on_its_way_still_gives_its_rebound():
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    for hidden in (5, 20):
        records[hidden] = replace(records[hidden], seen=np.zeros(1, dtype=bool))
    (found,) = _found(records)
    assert found.outgoing / found.incoming == pytest.approx(0.9, abs=0.01)


def test_a_bead_that_turns_sideways_at_the_wall_met_somebody_unseen():
    assert _found(tracks_of(bounced(TIMES, 4e-3, 0.9, change=2e-3), jitter=0.02 * PIXEL)) == []


def test_a_bead_that_turns_far_from_walls_gives_no_rebound():
    ways = bounced(TIMES, 4e-3, 0.9) + np.array((3e-3, 0.0))
    assert _found(tracks_of(ways, jitter=0.02 * PIXEL)) == []


def test_another_bead_within_reach_spoils_a_rebound():
    ways = bounced(TIMES, 4e-3, 0.9)
    for distance, expected in ((2.05e-3, 0), (4e-3, 1)):
        other = ways * (0.0, 1.0) + (1e-3, distance)
        found = _found(tracks_of(np.concatenate([ways, other], axis=1), jitter=0.02 * PIXEL))
        assert len(found) == expected


def test_grains_with_corners_are_left_out():
    tray = load_trays()[8]
    assert _found(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL), tray) == []


def _collision(partner_change):
    """Two beads that meet head on, restitution 0.8, the second changed in its velocity."""
    since = TIMES - 0.4
    first = np.where(since < 0.0, 2e-3 * since, -1.6e-3 * since)
    second = -first + np.where(since > 0.0, partner_change * since, 0.0)
    flat = np.full(TIMES.size, 7e-3)
    ways = [np.column_stack([x, flat]) for x in (6e-3 + first, 8e-3 + second)]
    return np.stack(ways, axis=1)


def test_two_beads_that_meet_are_one_collision():
    (found,) = _found(tracks_of(_collision(0.0), jitter=0.02 * PIXEL))
    assert found.tracks.tolist() == [0, 1] or found.tracks.tolist() == [1, 0]
    assert np.hypot(*found.separation) == pytest.approx(2e-3, rel=0.01)
    parting = np.hypot(*(found.after[1] - found.after[0]))
    assert parting / np.hypot(*(found.before[1] - found.before[0])) == pytest.approx(0.8, abs=0.01)
    assert found.masses[0] == pytest.approx(1180.0 * math.pi / 6.0 * 8e-9)


def test_a_collision_that_loses_momentum_met_somebody_unseen():
    assert _found(tracks_of(_collision(1.5e-3), jitter=0.02 * PIXEL)) == []


def test_beads_that_merge_are_no_collision():
    ways = _collision(0.0)
    ways[TIMES > 0.4] = ways[TIMES <= 0.4][-1]
    assert _found(tracks_of(ways, jitter=0.02 * PIXEL)) == []
