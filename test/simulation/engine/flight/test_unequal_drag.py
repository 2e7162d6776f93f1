"""Contacts of two beads that a gas slows at different rates: none is missed, none is invented."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gases import KERNELS, gas_of, near
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

ROOM = (400.0, 400.0, 400.0)


def contact_time(x, v, rates, reach, end):
    """First time at which two free beads touch, by a fine scan and Brent's method; or None."""

    def gap(t):
        path = v * (-np.expm1(-rates * t) / rates)[:, np.newaxis]
        return np.linalg.norm(x[1] + path[1] - x[0] - path[0]) - reach

    times = np.linspace(0.0, end, 4001)
    gaps = [gap(t) for t in times]
    closed = np.flatnonzero(np.array(gaps) < 0.0)
    if closed.size == 0:
        return None, min(gaps)
    return brentq(gap, times[closed[0] - 1], times[closed[0]], xtol=1e-14), min(gaps)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**9))
def test_the_first_contact_is_that_of_a_scan_of_the_exact_path(seed):
    random = np.random.default_rng(seed)
    rates = 10.0 ** random.uniform(-3.0, 0.5, 2)
    x = np.array([(200.0, 200.0, 200.0)] * 2)
    x[1] += random.uniform(2.1, 8.0) * unit(random)
    v = random.normal(size=(2, 3))
    # Half of them aimed at each other.
    if random.random() < 0.5:
        v[0] = 2.0 * random.random() * (x[1] - x[0]) + 0.3 * random.normal(size=3)
    end = 20.0
    expected, least = contact_time(x, v, rates, 2.0, end)
    events = gas_of(x, v, drag=rates, box=ROOM).follow(end, log=True).events
    if expected is None:
        # The scan can step over a contact that only grazes.
        assert events.size == 0 or least < 1e-3
    else:
        assert events['kind'][0] == 'pair'
        assert events['time'][0] == pytest.approx(expected, rel=1e-10, abs=1e-10)


def unit(random):
    direction = random.normal(size=3)
    return direction / np.linalg.norm(direction)


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_bead_that_is_slowed_more_is_caught_up_with_by_a_slower_one(kernel):
    """Apart at first: 1 - exp(-t) ahead of the other at 0.5 t, which catches up."""
    gas = gas_of(
        [(50, 200, 200), (52.1, 200, 200)],
        [(0.5, 0, 0), (1.0, 0, 0)],
        drag=np.array([0.0, 1.0]),
        box=ROOM,
        kernel=kernel,
    )
    event = gas.follow(10.0, log=True).events[0]
    time = brentq(lambda t: 0.1 - math.expm1(-t) - 0.5 * t, 0.5, 10.0, xtol=1e-14)
    assert event['time'] == near(time)
    assert event['normal_speed'] == near(0.5 - math.exp(-time))


@pytest.mark.parametrize('restitution', [0.0, 0.5])
def test_a_bead_that_pushes_another_through_the_gas_does_not_stop_time(restitution):
    """Both go on as one with the drag of both, but for contacts a contact duration apart."""
    duration = 1e-3
    gas = gas_of(
        [(50, 200, 200), (52.5, 200, 200)],
        [(1.0, 0, 0), (0.0, 0, 0)],
        drag=np.array([0.01, 0.5]),
        restitution=restitution,
        contact_duration=duration,
        box=ROOM,
    )
    gas.follow(20.0, most_events=100_000)
    before = gas.beads()
    gas.follow(30.0, most_events=100_000)
    after = gas.beads()
    assert gas.counts.pair > 1000
    assert np.linalg.norm(after.positions[1] - after.positions[0]) == pytest.approx(2.0, abs=1e-3)
    assert after.velocities[0] == pytest.approx(after.velocities[1], abs=1e-3)
    # Momentum is lost at the rate of each alone: together at the mean of both.
    left = after.velocities[:, 0].sum() / before.velocities[:, 0].sum()
    assert left == pytest.approx(math.exp(-0.255 * 10.0), rel=0.01)
