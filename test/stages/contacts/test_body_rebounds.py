"""A rod of two beads that turns shows the restitution of the wall where it touches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import NS, Merge, Tracks
from nanorocks_ros.stages.contacts.body_rebounds import BodyRebounds

TRAY = load_trays()[1]
RADIUS = 0.5 * TRAY.species[0].diameter
WIDTH = TRAY.dimensions[0]
RATE, CONTACT, SECONDS = 30.0, 2.013, 4.5
ERROR = 7.4e-6
WALL = 0.8
ANGLE, SPIN, VELOCITY = 0.7, 1.1, np.array([2.5e-3, 0.4e-3])


def rod_positions(times, wall=WALL):
    """Places (n, 2, 2) of the beads of a rod that hits the wall at high x, at `CONTACT`.

    In the plane, with unit mass of each bead: the impulse at the bead that touches changes the
    velocity of the centre by half of it, and the spin by the lever arm over the inertia.
    """
    arm = RADIUS * np.array([np.cos(ANGLE), np.sin(ANGLE)])
    centre = np.array([WIDTH - RADIUS, 0.5 * WIDTH]) - arm
    inertia = 2.0 * (RADIUS**2 + 0.4 * RADIUS**2)
    approach = VELOCITY[0] - SPIN * arm[1]
    impulse = (1.0 + wall) * approach / (0.5 + arm[1] ** 2 / inertia)
    after = VELOCITY - (0.5 * impulse, 0.0)
    spin_after = SPIN + arm[1] * impulse / inertia
    since = times - CONTACT
    is_before = since < 0.0
    middle = centre + since[:, None] * np.where(is_before[:, None], VELOCITY, after)
    turn = ANGLE + since * np.where(is_before, SPIN, spin_after)
    arms = RADIUS * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return np.stack([middle + arms, middle - arms], axis=1)


def rod_tracks(seed, wall=WALL):
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, SECONDS, 1.0 / RATE)
    for time, places in zip(times, rod_positions(times, wall), strict=True):
        yield Tracks(
            stamp_ns=round(time * NS),
            tray=1,
            ids=np.array([4, 9], dtype=np.int32),
            species=np.zeros(2, dtype=np.int32),
            displacement=np.zeros(2),
            positions=places + rng.normal(0.0, ERROR, (2, 2)),
            position_errors=np.full(2, ERROR),
            velocities=np.zeros((2, 2)),
            velocity_errors=np.full(2, 1e-4),
            radii=np.full(2, RADIUS),
            radius_errors=np.full(2, ERROR),
            seen=np.ones(2, dtype=np.bool_),
            expected=np.array([15], dtype=np.int32),
            cycle=1,
        )


def merge(time):
    return Merge(
        stamp_ns=round(time * NS),
        known_ns=round((time + 0.5) * NS),
        tray=1,
        cycle=1,
        tracks=np.array([4, 9], dtype=np.int32),
        joins=True,
    )


def rebounds_of(tracks, *merges):
    finder = BodyRebounds(TRAY)
    found, waiting = [], list(merges)
    for frame in tracks:
        found += finder.push(frame)
        while waiting and waiting[0].known_ns <= frame.stamp_ns:
            found += finder.push(waiting.pop(0))
    return found


@pytest.mark.parametrize('wall', [0.8, 0.97])
def test_a_rod_that_turns_shows_the_restitution_of_the_wall(wall):
    deviations = []
    for seed in range(24):
        (rebound,) = rebounds_of(rod_tracks(seed, wall), merge(0.3))
        assert rebound.beads == 2
        assert (rebound.wall, rebound.track) == (1, 4)
        assert rebound.stamp_ns == pytest.approx(CONTACT * NS, abs=NS / RATE)
        error = np.hypot(rebound.incoming.error, rebound.outgoing.error)
        assert error < 0.1 * rebound.incoming.value
        deviations.append((rebound.outgoing.value - wall * rebound.incoming.value) / error)
    assert abs(np.mean(deviations)) < 1.0
    assert 0.3 < np.std(deviations) < 1.8


def test_the_lever_arm_counts():
    # A bead of the rod that is not allowed for would return with another speed than it came.
    (rebound,) = rebounds_of(rod_tracks(0), merge(0.3))
    arm = RADIUS * np.sin(ANGLE)
    assert rebound.incoming.value == pytest.approx(VELOCITY[0] - SPIN * arm, rel=0.03)


def test_beads_that_are_not_known_to_be_one_body_have_no_rebound_of_a_body():
    assert rebounds_of(rod_tracks(0)) == []
    # A body that forms between the frames of the fit is not the same before and after.
    assert rebounds_of(rod_tracks(0), merge(CONTACT - 0.05)) == []


def test_a_tray_that_swings_gives_none():
    swinging = [
        replace(
            frame,
            displacement=np.array([2e-4 * np.sin(25.0 * frame.stamp_ns / NS), 0.0]),
        )
        for frame in rod_tracks(0)
    ]
    assert rebounds_of(swinging, merge(0.3)) == []


def test_a_hidden_bead_gives_none():
    hidden = [
        replace(frame, seen=np.array([True, abs(frame.stamp_ns / NS - CONTACT) > 0.6]))
        for frame in rod_tracks(0)
    ]
    assert rebounds_of(hidden, merge(0.3)) == []


def test_the_end_of_a_recording_gives_out_what_is_held_back():
    finder = BodyRebounds(TRAY)
    finder.push(merge(0.3))
    early = [frame for frame in rod_tracks(0) if frame.stamp_ns < (CONTACT + 0.5) * NS]
    assert [rebound for frame in early for rebound in finder.push(frame)] == []
    (rebound,) = finder.flush()
    assert rebound.stamp_ns == pytest.approx(CONTACT * NS, abs=NS / RATE)
    assert finder.flush() == ()


def test_a_shaking_event_separates_all_bodies():
    shaken = [
        replace(frame, cycle=1 if frame.stamp_ns < 1.2 * NS else 2) for frame in rod_tracks(0)
    ]
    assert rebounds_of(shaken, merge(0.3)) == []
