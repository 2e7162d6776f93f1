"""Times of pictures, from beads that fly straight."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.flights.frame_times import FrameTimes

RATE, BEADS, ERROR = 30.0, 15, 8e-6
PICTURES = 300


def pictures(late, *, speed=5e-3, shared=0.0, turns=0.0, fall=0.0, drag=0.0, seed=1):
    """Tracks of beads in flight, and by how much each picture is late, [s].

    `shared` displaces all beads of a picture alike, `turns` is the share that is struck in each
    picture, and between these they fall, [m/s²], and are slowed, [1/s].
    """
    rng = np.random.default_rng(seed)
    off = np.clip(late * rng.standard_normal(PICTURES), -0.45 / RATE, 0.45 / RATE)
    places = rng.uniform(0.0, 0.1, (BEADS, 2))
    velocities = rng.normal(0.0, speed, (BEADS, 2))
    tracks = []
    for number in range(PICTURES):
        struck = rng.random(BEADS) < turns
        velocities[struck] = rng.normal(0.0, speed, (struck.sum(), 2))
        seen = places + off[number] * velocities + rng.normal(0.0, ERROR, places.shape)
        tracks.append(picture(number, seen + shared * rng.standard_normal(2)))
        places = places + velocities / RATE
        velocities = velocities * np.exp(-drag / RATE) + np.array([fall / RATE, 0.0])
    return tracks, off


def picture(number, places, ids=None):
    beads = len(places)
    unknown = np.full(beads, np.nan)
    return Tracks(
        stamp_ns=round(number / RATE * 1e9),
        tray=1,
        ids=np.arange(beads, dtype=np.int32) if ids is None else ids,
        species=np.zeros(beads, dtype=np.int32),
        displacement=np.zeros(2),
        positions=places,
        position_errors=np.full(beads, ERROR),
        velocities=np.full((beads, 2), np.nan),
        velocity_errors=unknown,
        radii=np.full(beads, 1e-3),
        radius_errors=unknown,
        seen=np.ones(beads, dtype=bool),
        expected=np.array([beads], dtype=np.int32),
    )


def corrected(tracks):
    """Corrections of all pictures, [s], in the order in which they are given out."""
    times = FrameTimes()
    given = [pair for record in tracks for pair in times.push(record.stamp_ns / 1e9, record)]
    given += times.flush()
    assert [record.stamp_ns for _, record in given] == [record.stamp_ns for record in tracks]
    return times, np.array([time - record.stamp_ns / 1e9 for time, record in given])


@pytest.mark.parametrize('turns', [0.0, 0.02])
def test_late_pictures_get_the_times_at_which_they_were_taken(turns):
    tracks, late = pictures(3e-3, turns=turns)
    times, corrections = corrected(tracks)
    assert times.scatter == pytest.approx(3e-3, rel=0.25)
    # Until it is known that they are late none is corrected, nor are the last.
    known = slice(80, -6)
    assert np.std(corrections[known] - late[known]) < 0.45 * np.std(late[known])
    assert abs(np.mean(corrections[known])) < 3e-4
    taken = np.array([record.stamp_ns / 1e9 for record in tracks]) + corrections
    assert (np.diff(taken) > 0.0).all()


@pytest.mark.parametrize(
    'values',
    [
        {},
        {'speed': 5e-4},
        {'turns': 0.05},
        {'shared': 5e-5},
        {'fall': 5e-3, 'turns': 0.02},
        {'drag': 0.3, 'turns': 0.02},
    ],
    ids=str,
)
def test_pictures_in_time_are_given_at_once_with_the_times_of_their_stamps(values):
    tracks, _ = pictures(0.0, **values)
    times = FrameTimes()
    for record in tracks:
        assert times.push(record.stamp_ns / 1e9, record) == [(record.stamp_ns / 1e9, record)]
    assert times.scatter == 0.0
    assert times.flush() == []


def test_each_picture_is_held_back_until_five_more_have_come():
    tracks, _ = pictures(3e-3)
    times = FrameTimes()
    given = 0
    for number, record in enumerate(tracks, start=1):
        given += len(times.push(record.stamp_ns / 1e9, record))
        assert number - given == 0 or (times.scatter and number - given <= 5)
    assert number - given == 5
    assert [record for _, record in times.flush()] == tracks[-5:]


def test_a_lost_picture_is_not_taken_for_a_late_one():
    tracks, _ = pictures(0.0)
    places = [record.positions for record in tracks]
    lost = [picture(number, place) for number, place in enumerate(places[:150] + places[151:])]
    times, corrections = corrected(lost)
    assert times.scatter == 0.0
    assert not corrections.any()


def test_beads_that_come_and_go_are_followed_by_their_numbers():
    tracks, late = pictures(3e-3)
    some = []
    for number, record in enumerate(tracks):
        # Another bead is away every 40 pictures.
        away = np.random.default_rng(number // 40).integers(BEADS)
        ids = np.delete(np.arange(BEADS, dtype=np.int32), away)
        some.append(picture(number, record.positions[ids], ids))
    _, corrections = corrected(some)
    known = slice(80, -6)
    assert np.std(corrections[known] - late[known]) < 0.5 * np.std(late[known])
