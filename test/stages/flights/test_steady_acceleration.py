"""The acceleration that all beads share, from pieces of their tracks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, tracks_of

from nanorocks_ros.stages.flights.steady_acceleration import steady_acceleration

TIME = np.arange(90) / RATE
NOISE = 0.1 * PIXEL


def thrown(acceleration, *, kick_every=0.6):
    """Three beads that accelerate, and are kicked from time to time."""
    rng = np.random.default_rng(2)
    places = []
    for _ in range(3):
        since = TIME % kick_every
        kicks = rng.normal(0.0, 0.006, (1 + int(TIME[-1] / kick_every), 2))
        velocity = kicks[(TIME / kick_every).astype(int)] + since[:, None] * acceleration
        steps = velocity[:-1] / RATE + 0.5 * np.array(acceleration) / RATE**2
        places.append(np.vstack([np.full(2, 0.02), 0.02 + np.cumsum(steps, axis=0)]))
    return np.stack(places, axis=1)


@pytest.mark.parametrize('acceleration', [(0.0, 0.02), (-0.01, 0.004)])
def test_kicks_do_not_hide_the_acceleration(acceleration):
    result = steady_acceleration(tracks_of(thrown(acceleration), jitter=NOISE))
    assert result.is_seen
    assert result.value == pytest.approx(acceleration, abs=5.0 * result.error)
    assert result.correction == result.value


def test_beads_at_rest_beside_falling_ones_do_not_count():
    falling = thrown((0.0, 0.02))
    resting = np.broadcast_to(np.array([0.01, 0.03]), (len(TIME), 6, 2))
    both = np.concatenate([falling, resting], axis=1)
    result = steady_acceleration(tracks_of(both, jitter=NOISE))
    assert result.value == pytest.approx((0.0, 0.02), abs=5.0 * result.error)


def test_without_acceleration_nothing_is_corrected():
    result = steady_acceleration(tracks_of(thrown((0.0, 0.0)), jitter=NOISE))
    assert not result.is_seen
    assert result.correction == (0.0, 0.0)


def test_too_few_places_tell_nothing():
    result = steady_acceleration(tracks_of(thrown((0.0, 0.02))[:8], jitter=NOISE))
    assert math.isnan(result.size)
    assert result.correction == (0.0, 0.0)


@pytest.mark.parametrize('acceleration', [(0.0, 0.4), (0.28, 0.28)])
def test_balls_that_roll_for_most_of_the_film_do_not_hide_the_fall_of_others(acceleration):
    falling = thrown(acceleration)
    along = np.array([acceleration[1], -acceleration[0]]) / np.hypot(*acceleration)
    speeds = np.linspace(0.005, 0.03, 6)
    rolling = 0.02 + TIME[:, None, None] * speeds[:, None] * along
    both = np.concatenate([falling, rolling], axis=1)
    result = steady_acceleration(tracks_of(both, jitter=NOISE))
    assert result.value == pytest.approx(acceleration, abs=5.0 * result.error)
    assert result.is_seen
    steady = steady_acceleration(tracks_of(rolling, jitter=NOISE))
    assert not steady.is_seen


def test_few_bent_paths_among_many_straight_ones_are_no_gravity():
    bent = thrown((0.0, 0.4))
    rng = np.random.default_rng(8)
    straight = 0.02 + TIME[:, None, None] * rng.normal(0.0, 0.02, (30, 2))
    both = np.concatenate([bent[:, :1], straight], axis=1)
    assert not steady_acceleration(tracks_of(both, jitter=NOISE)).is_seen
