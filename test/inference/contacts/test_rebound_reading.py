"""Rebounds as a camera sees them that reads row by row, and what they tell of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.inference.contacts.contact_likelihood import rebound_log_likelihood
from nanorocks_ros.inference.contacts.rebound_reading import AS_SEEN, SWING_ERROR, rebound_reading
from nanorocks_ros.records import Measured, Rebound

SIDES = 0.03, 0.02
READOUT, PRIOR = 0.03, 0.02
WALLS, ERROR = 0.96, 1e-4
GRID = np.linspace(0.9, 1.0, 1001)


def seen(seed, count, delays, walls=(0, 1, 2, 3)):
    """Rebounds from these walls, as seen where places are delayed by so much, [s/m]."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        wall, before = int(random.choice(walls)), random.uniform(2e-3, 12e-3)
        # Velocities along the readout: towards the wall, and back from it.
        outward = 1.0 if wall % 2 else -1.0
        delay = delays[wall // 2]
        velocities = np.array([outward * before, -outward * WALLS * before])
        speeds = np.abs(velocities / (1.0 - delay * velocities)) + random.normal(0.0, ERROR, 2)
        yield Rebound(
            stamp_ns=0,
            tray=1,
            cycle=1,
            track=0,
            species=0,
            wall=wall,
            incoming=Measured(float(speeds[0]), ERROR),
            outgoing=Measured(float(speeds[1]), ERROR),
            tangential_incoming=0.0,
            tangential_outgoing=0.0,
            tangential_error=ERROR,
            wall_velocity=Measured(0.0, 0.0),
            place=np.zeros(2),
        )


def likely(rebounds):
    return GRID[np.argmax(rebound_log_likelihood(rebounds, GRID))]


@pytest.mark.parametrize('sign', [-1.0, 1.0])
@pytest.mark.parametrize('axis', [0, 1])
def test_the_readout_is_found_along_either_side_in_either_direction(axis, sign):
    delays = [0.0, 0.0]
    delays[axis] = sign * READOUT / SIDES[axis]
    reading = rebound_reading(list(seen(1, 80, delays)), SIDES, PRIOR)
    found = reading.along_columns, reading.along_rows
    for delay, true in zip(found, delays, strict=True):
        assert abs(delay.value - true) < 3.0 * delay.error
        assert delay.error < 0.2 * READOUT / SIDES[axis]


def test_errors_of_the_readout_are_those_stated():
    pulls = []
    for seed in range(60):
        delays = np.random.default_rng([seed, 1]).normal(0.0, PRIOR / np.array(SIDES))
        reading = rebound_reading(list(seen(seed, 40, delays)), SIDES, PRIOR)
        pairs = zip((reading.along_columns, reading.along_rows), delays, strict=True)
        pulls += [(delay.value - true) / delay.error for delay, true in pairs if delay.error]
    assert len(pulls) > 100
    assert 0.8 < np.std(pulls) < 1.2
    assert abs(np.mean(pulls)) < 0.3


def test_walls_are_read_as_by_a_camera_that_reads_all_at_once():
    # More rebounds from one wall than from the one opposite.
    delays = 0.0, READOUT / SIDES[1]
    rebounds = list(seen(2, 150, delays, walls=(2, 3, 3, 3)))
    assert abs(likely(rebounds) - WALLS) > 0.006
    reading = rebound_reading(rebounds, SIDES, PRIOR)
    assert likely([reading.read(each) for each in rebounds]) == pytest.approx(WALLS, abs=0.003)


def test_a_restitution_that_depends_on_speed_is_no_readout():
    rebounds = [
        replace(
            each,
            outgoing=Measured((1.0 - 5.0 * each.incoming.value) * each.outgoing.value, ERROR),
        )
        for each in seen(7, 150, (0.0, 0.0), walls=(0, 2, 3, 3, 3))
    ]
    reading = rebound_reading(rebounds, SIDES, PRIOR)
    assert 0.0 < reading.along_rows.error < 0.1 / SIDES[1] * READOUT
    for delay in (reading.along_columns, reading.along_rows):
        assert abs(delay.value) < 3.0 * delay.error


def test_walls_that_are_not_alike_are_no_readout_where_they_need_not_be():
    rebounds = [
        replace(each, outgoing=Measured(0.9 * each.outgoing.value, ERROR))
        if each.wall == 3
        else each
        for each in seen(8, 150, (0.0, 0.0))
    ]
    alike, unlike = (
        rebound_reading(rebounds, SIDES, PRIOR, walls_alike=walls_alike).along_rows
        for walls_alike in (True, False)
    )
    assert alike.value > 5.0 * alike.error
    assert abs(unlike.value) <= 3.0 * unlike.error
    assert unlike.error < 0.3 * READOUT / SIDES[1]


def test_rebounds_from_one_wall_tell_nothing_and_stay_as_they_are():
    rebounds = list(seen(3, 40, (0.0, READOUT / SIDES[1]), walls=(3,)))
    reading = rebound_reading(rebounds, SIDES, PRIOR)
    assert reading == AS_SEEN
    assert reading.read(rebounds[0]) is rebounds[0]


@pytest.mark.parametrize(('count', 'readout'), [(4, PRIOR), (80, 0.0)])
def test_few_rebounds_or_a_camera_known_to_read_change_nothing(count, readout):
    rebounds = list(seen(4, count, (0.0, READOUT / SIDES[1])))
    assert rebound_reading(rebounds, SIDES, readout) == AS_SEEN


def test_rebounds_of_bodies_and_strays_count_little():
    delays = 0.0, READOUT / SIDES[1]
    good = list(seen(5, 80, delays))
    strays = [
        replace(each, outgoing=Measured(3.0 * each.incoming.value, ERROR)) for each in good[:6]
    ]
    bodies = [replace(each, beads=3) for each in strays]
    without, others = (
        rebound_reading(rebounds, SIDES, PRIOR) for rebounds in (good, [*good, *bodies])
    )
    assert without == others
    with_strays = rebound_reading([*good, *strays], SIDES, PRIOR).along_rows
    assert abs(with_strays.value - without.along_rows.value) < without.along_rows.error


@pytest.mark.parametrize('walls_alike', [True, False])
def test_rebounds_that_are_all_alike_tell_nothing_of_a_law(walls_alike):
    (one,) = seen(9, 1, (0.0, 0.0))
    exact = replace(
        one,
        incoming=Measured(5e-3, 0.0),
        outgoing=Measured(WALLS * 5e-3, 0.0),
        wall_velocity=Measured(0.0, 0.0),
    )
    rebounds = [replace(exact, wall=wall) for wall in (0, 1, 2, 3) * 3]
    reading = rebound_reading(rebounds, SIDES, PRIOR, walls_alike=walls_alike)
    for delay in (reading.along_columns, reading.along_rows):
        assert delay.value == pytest.approx(0.0, abs=1e-6)


def swung(seed, count, share, noise=1e-5, swing=1e-3):
    """Rebounds from walls that swing, of which this share of the true velocity is registered."""
    random = np.random.default_rng([seed, 4])
    for rebound in seen(seed, count, (0.0, 0.0)):
        # Beads meet walls that come towards them more often.
        true = random.normal(-swing, swing)
        registered = share * true + random.normal(0.0, noise)
        off = registered - true
        yield replace(
            rebound,
            incoming=Measured(rebound.incoming.value - off, ERROR),
            outgoing=Measured(rebound.outgoing.value + off, ERROR),
            wall_velocity=Measured(registered, math.hypot(noise, SWING_ERROR * registered)),
        )


@pytest.mark.parametrize('share', [0.9, 1.08])
def test_walls_that_move_faster_or_slower_than_they_are_registered_are_known_by_rebounds(share):
    rebounds = list(swung(10, 60, share))
    reading = rebound_reading(rebounds, SIDES, PRIOR)
    assert reading.swing.value == pytest.approx(1.0 / share - 1.0, abs=3.0 * reading.swing.error)
    assert reading.swing.error < 0.25 * SWING_ERROR
    before, after = likely(rebounds), likely([reading.read(each) for each in rebounds])
    assert abs(before - WALLS) > 0.01
    assert after == pytest.approx(WALLS, abs=0.005)


def test_errors_of_the_swing_are_those_stated():
    pulls = []
    for seed in range(60):
        share = 1.0 / (1.0 + np.random.default_rng([seed, 6]).normal(0.0, SWING_ERROR))
        swing = rebound_reading(list(swung(seed, 30, share)), SIDES, PRIOR).swing
        pulls.append((swing.value - (1.0 / share - 1.0)) / swing.error)
    assert 0.8 < np.std(pulls) < 1.2
    assert abs(np.mean(pulls)) < 0.4


def test_walls_that_rest_tell_no_swing_and_stay_as_they_are():
    rebounds = list(swung(11, 60, 1.0, noise=1e-4, swing=1e-9))
    reading = rebound_reading(rebounds, SIDES, 0.0)
    assert reading.read(rebounds[0]) is rebounds[0]
    assert reading.error < 5e-4
