"""Contacts found in tracks against the collisions of an event-driven simulation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, bounced, tracks_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import FreeFlight, PairCollision, Rebound
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder

TRAY = load_trays()[1]
PAIRS, WALLS = 0.85, 0.93
TIMES = np.arange(36) / RATE


def _pushed(finder, records):
    return _without_flights(result for record in records for result in finder.push(record))


def _flushed(finder):
    return _without_flights(finder.flush())


def _without_flights(results):
    return [result for result in results if not isinstance(result, FreeFlight)]


def _contacts_in(tracks, tray=TRAY):
    finder = ContactFinder(tray)
    contacts = _pushed(finder, tracks)
    return [*contacts, *_flushed(finder)]


@pytest.fixture(scope='module')
def gas():
    """Events of a simulated cooling tray, and the contacts found in its tracks."""
    settings = SimulationSettings(
        restitution=PAIRS, wall_restitution=WALLS, seed=4, mean_speed=0.006
    )
    rules = rules_of(settings, TRAY)
    beads = after_shaking(settings, rules, resting_beads(settings, TRAY), 0, 0)
    times = np.arange(900) / RATE
    run = HardSphereGas(beads, rules).follow(times[-1], times, log=True)
    planar = run.positions[:, :, :2]
    tracks = tracks_of(planar, velocities=run.velocities[:, :, :2], jitter=0.02 * PIXEL)
    return run.events, _contacts_in(tracks)


def _events(events, kind, time):
    near = np.abs(events['time'] - time) < 0.5 / RATE
    return events[near & (events['kind'] == kind)]


def test_every_rebound_is_a_simulated_collision_with_that_wall(gas):
    events, contacts = gas
    rebounds = [contact for contact in contacts if isinstance(contact, Rebound)]
    assert len(rebounds) > 15
    for rebound in rebounds:
        hits = _events(events, 'wall', rebound.stamp_ns / 1e9)
        hit = hits[(hits['bead'] == rebound.track) & (hits['partner'] == rebound.wall)]
        assert hit.size == 1
        assert rebound.incoming.value == pytest.approx(
            hit['normal_speed'][0], abs=5.0 * rebound.incoming.error
        )


def test_rebounds_return_the_restitution_of_the_wall_within_their_errors(gas):
    rebounds = [contact for contact in gas[1] if isinstance(contact, Rebound)]
    errors = np.array(
        [math.hypot(rebound.outgoing.error, rebound.incoming.error) for rebound in rebounds]
    )
    misses = np.array(
        [rebound.outgoing.value - WALLS * rebound.incoming.value for rebound in rebounds]
    )
    assert np.median(np.abs(misses / errors)) < 1.0
    assert np.median(
        [rebound.outgoing.value / rebound.incoming.value for rebound in rebounds]
    ) == pytest.approx(WALLS, abs=0.01)


def test_every_collision_is_a_simulated_collision_of_those_two_beads(gas):
    events, contacts = gas
    pairs = [contact for contact in contacts if isinstance(contact, PairCollision)]
    assert len(pairs) > 15
    wrong = 0
    for pair in pairs:
        hits = _events(events, 'pair', pair.stamp_ns / 1e9)
        names = np.sort(np.column_stack([hits['bead'], hits['partner']]), axis=1)
        wrong += not (names == np.sort(pair.tracks)).all(axis=1).any()
    assert wrong <= 1


@pytest.mark.parametrize(('seen', 'compared'), [(1.01, 1.01), (0.99, 0.99), (1.06, 1.02)])
def test_distances_are_compared_with_the_radii_that_show(seen, compared):
    """All beads are told to be alike; nearer to the camera they and their distances are larger."""
    half = 1e-3
    before = 2e-3 * (TIMES[TIMES <= 0.6] - 0.6) - half
    after = -1e-3 * (TIMES[TIMES > 0.6] - 0.6) - half
    x = np.concatenate([before, after])
    y = np.full_like(x, 7e-3)
    paths = np.stack([np.column_stack([7e-3 + x, y]), np.column_stack([7e-3 - x, y])], axis=1)
    tracks = [replace(record, radii=seen * record.radii) for record in tracks_of(paths)]
    (pair,) = (each for each in _contacts_in(tracks) if isinstance(each, PairCollision))
    assert pair.radii == pytest.approx(np.full(2, compared * 1e-3))


def test_collisions_conserve_momentum_and_separate_along_the_normal(gas):
    for contact in gas[1]:
        if isinstance(contact, PairCollision):
            lost = np.abs((contact.after - contact.before).sum(axis=0)).max()
            assert lost < 6.0 * np.hypot(contact.before_errors, contact.after_errors).max()
            assert np.hypot(*contact.separation) == pytest.approx(2e-3, rel=0.11)
            assert (contact.after[1] - contact.after[0]) @ contact.separation > (
                contact.before[1] - contact.before[0]
            ) @ contact.separation


def test_the_same_tracks_give_the_same_contacts_again_after_going_back():
    tracks = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    finder = ContactFinder(TRAY)
    first = _pushed(finder, tracks) + _flushed(finder)
    again = _pushed(finder, tracks) + _flushed(finder)
    assert len(first) == 1
    assert [contact.outgoing.value for contact in again] == [first[0].outgoing.value]


def test_flush_gives_a_rebound_right_before_the_end_of_the_tracks():
    # The bead touches the wall at frame 12; four places after it make the second flight.
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))[:17]
    finder = ContactFinder(TRAY)
    assert _pushed(finder, records) == []
    (rebound,) = _flushed(finder)
    assert isinstance(rebound, Rebound)
    assert rebound.stamp_ns == pytest.approx(0.4e9, abs=0.01e9)
    assert rebound.outgoing.value / rebound.incoming.value == pytest.approx(0.9, abs=0.03)
    assert _flushed(finder) == []


def test_flush_gives_a_collision_right_before_the_end_of_the_tracks():
    records = list(tracks_of(_collision(0.0), jitter=0.02 * PIXEL))[:19]
    finder = ContactFinder(TRAY)
    assert _pushed(finder, records) == []
    (collision,) = _flushed(finder)
    assert isinstance(collision, PairCollision)
    assert sorted(collision.tracks.tolist()) == [0, 1]
    assert collision.stamp_ns == pytest.approx(0.4e9, abs=0.01e9)


def test_tracks_that_go_on_after_a_flush_begin_new_flights():
    times = np.arange(90) / RATE
    positions = bounced(times, 3e-3, 0.9, at=2.0)
    records = list(tracks_of(positions, jitter=0.02 * PIXEL))
    finder = ContactFinder(TRAY)
    contacts = _pushed(finder, records[:30])
    contacts += _flushed(finder)
    assert contacts == []
    contacts = _pushed(finder, records[30:])
    (rebound,) = [*contacts, *_flushed(finder)]
    assert rebound.stamp_ns == pytest.approx(2.0e9, abs=0.01e9)


def test_reset_forgets_contacts_that_are_held_back():
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    finder = ContactFinder(TRAY)
    for record in records:
        finder.push(record)
    finder.reset()
    assert _flushed(finder) == []
    assert len(_pushed(finder, records)) == 0
    assert len(_flushed(finder)) == 1


def test_a_rebound_is_measured_relative_to_the_swinging_wall():
    omega = 2.0 * math.pi * 1.5

    def wall(time):
        return 1.5e-4 * np.sin(omega * time)

    times = np.arange(90) / RATE
    displacements = np.column_stack([wall(times), np.zeros(times.size)])
    for at in (1.25, 1.5, 1.7):
        positions = bounced(times, 3e-3, 0.9, at=at, along=1e-3, wall=wall)
        near_contact = (times > at - 0.4) & (times < at + 0.4)
        records = list(tracks_of(positions, displacements=displacements, jitter=0.01 * PIXEL))
        hidden = [
            record if is_near else replace(record, seen=np.zeros(1, dtype=bool))
            for record, is_near in zip(records, near_contact, strict=True)
        ]
        (rebound,) = _contacts_in(hidden)
        assert rebound.wall == 0
        true = -1.5e-4 * omega * np.cos(omega * at)
        assert rebound.wall_velocity.value == pytest.approx(true, abs=3e-5)
        assert rebound.outgoing.value / rebound.incoming.value == pytest.approx(0.9, abs=0.02)


def test_a_bead_that_is_hidden_at_the_wall_gives_no_rebound():
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    assert len(_contacts_in(records)) == 1
    records[12] = replace(records[12], seen=np.zeros(1, dtype=bool))
    assert _contacts_in(records) == []


def test_a_bead_that_is_hidden_during_a_flight_gives_its_rebound():
    records = list(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL))
    for hidden in (5, 20):
        records[hidden] = replace(records[hidden], seen=np.zeros(1, dtype=bool))
    (rebound,) = _contacts_in(records)
    assert rebound.outgoing.value / rebound.incoming.value == pytest.approx(0.9, abs=0.01)


def test_a_tangential_change_of_velocity_at_the_wall_is_no_rebound():
    assert (
        _contacts_in(tracks_of(bounced(TIMES, 4e-3, 0.9, change=2e-3), jitter=0.02 * PIXEL)) == []
    )


def test_a_velocity_jump_far_from_walls_is_no_rebound():
    positions = bounced(TIMES, 4e-3, 0.9) + np.array((3e-3, 0.0))
    assert _contacts_in(tracks_of(positions, jitter=0.02 * PIXEL)) == []


def test_a_rebound_with_another_bead_within_reach_is_left_out():
    positions = bounced(TIMES, 4e-3, 0.9)
    for distance, expected in ((2.05e-3, 0), (4e-3, 1)):
        other = positions * (0.0, 1.0) + (1e-3, distance)
        contacts = _contacts_in(
            tracks_of(np.concatenate([positions, other], axis=1), jitter=0.02 * PIXEL)
        )
        assert len(contacts) == expected


def test_angular_grains_are_left_out():
    tray = load_trays()[8]
    assert _contacts_in(tracks_of(bounced(TIMES, 4e-3, 0.9), jitter=0.02 * PIXEL), tray) == []


def _collision(partner_change):
    """Head-on collision at restitution 0.8; `partner_change` is added to the second velocity."""
    since = TIMES - 0.4
    first = np.where(since < 0.0, 2e-3 * since, -1.6e-3 * since)
    second = -first + np.where(since > 0.0, partner_change * since, 0.0)
    flat = np.full(TIMES.size, 7e-3)
    positions = [np.column_stack([x, flat]) for x in (6e-3 + first, 8e-3 + second)]
    return np.stack(positions, axis=1)


def test_two_beads_that_meet_are_one_collision():
    (collision,) = _contacts_in(tracks_of(_collision(0.0), jitter=0.02 * PIXEL))
    assert collision.tracks.tolist() == [0, 1] or collision.tracks.tolist() == [1, 0]
    assert np.hypot(*collision.separation) == pytest.approx(2e-3, rel=0.01)
    parting = np.hypot(*(collision.after[1] - collision.after[0]))
    assert parting / np.hypot(*(collision.before[1] - collision.before[0])) == pytest.approx(
        0.8, abs=0.01
    )
    assert collision.masses[0] == pytest.approx(1180.0 * math.pi / 6.0 * 8e-9)


def test_a_collision_that_loses_momentum_is_left_out():
    assert _contacts_in(tracks_of(_collision(1.5e-3), jitter=0.02 * PIXEL)) == []


def test_beads_that_merge_are_no_collision():
    positions = _collision(0.0)
    positions[TIMES > 0.4] = positions[TIMES <= 0.4][-1]
    assert _contacts_in(tracks_of(positions, jitter=0.02 * PIXEL)) == []
