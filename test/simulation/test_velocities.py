"""Random velocities follow their distributions, also in the tails, and are reproducible."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import pytest
from scipy import stats

from nanorocks_ros.numerics.counter_rng import Purpose, direction, hashed, key_for, uniform
from nanorocks_ros.simulation.velocities import maxwellian, normal_pair, uniform_speeds

KEY = key_for(1, 0, Purpose.VELOCITIES)
N = 200_000
SPEED = 0.007
# Deviation of a component of a Maxwellian gas of this mean speed.
DEVIATION = SPEED * math.sqrt(math.pi / 8.0)
ALIKE = np.full(N, 4e-6)


def sub_key(key, counter):
    """A hash as compiled code hands it on; Python gets it as an integer without a width."""
    return np.uint64(hashed(key, counter))


def speeds_of(velocities):
    return np.sqrt((velocities * velocities).sum(axis=1))


def test_shaken_speeds_are_drawn_as_ever():
    for shake in (0, 3):
        velocities = uniform_speeds(50, SPEED, KEY, shake)
        for i in range(50):
            speed = 2.0 * SPEED * uniform(sub_key(KEY, 2 * shake), i)
            along = direction(sub_key(sub_key(KEY, 2 * shake + 1), i))
            assert velocities[i].tolist() == [speed * x for x in along]


def test_shaken_speeds_are_even_from_zero_to_twice_the_mean():
    speeds = speeds_of(uniform_speeds(N, SPEED, KEY, 0))
    assert speeds.mean() == pytest.approx(SPEED, abs=4.0 * 2.0 * SPEED / math.sqrt(12.0 * N))
    assert stats.kstest(speeds, 'uniform', args=(0.0, 2.0 * SPEED)).pvalue > 1e-3


def test_a_maxwellian_gas_has_the_mean_speed_asked_for():
    speeds = speeds_of(maxwellian(ALIKE, SPEED, KEY, 0, False))
    error = SPEED * math.sqrt((3.0 * math.pi / 8.0 - 1.0) / N)
    assert speeds.mean() == pytest.approx(SPEED, abs=4.0 * error)


@pytest.mark.parametrize('shake', [0, 1, 2])
def test_its_speeds_and_components_obey_their_laws(shake):
    velocities = maxwellian(ALIKE, SPEED, KEY, shake, False)
    assert stats.kstest(speeds_of(velocities), 'maxwell', args=(0.0, DEVIATION)).pvalue > 1e-3
    for axis in range(3):
        law = stats.kstest(velocities[:, axis], 'norm', args=(0.0, DEVIATION))
        assert law.pvalue > 1e-3
    assert np.abs(np.corrcoef(velocities.T) - np.eye(3)).max() < 4.0 / math.sqrt(N)


@pytest.mark.parametrize(('power', 'moment', 'square'), [(2, 1, 3), (4, 3, 105), (6, 15, 10_395)])
def test_its_moments_are_those_of_the_normal_law_far_into_the_tails(power, moment, square):
    # <x^p> = (p-1)!!, with a variance of (2p-1)!! - (p-1)!!^2 for each of 3 N deviates.
    x = maxwellian(ALIKE, SPEED, KEY, 0, False).ravel() / DEVIATION
    error = math.sqrt((square - moment**2) / x.size)
    assert np.mean(x**power) == pytest.approx(moment, abs=4.0 * error)
    assert np.abs(x).max() > 4.4  # one of 6e5 exceeds it in all but 0.2 % of such samples


def test_bodies_of_two_masses_share_the_temperature_or_the_energy():
    masses = np.where(np.arange(N) % 2, 1.0, 9.0)
    light, heavy = masses == 1.0, masses == 9.0
    for equipartition, ratio in ((False, 1.0), (True, 3.0)):
        speeds = speeds_of(maxwellian(masses, SPEED, KEY, 0, equipartition))
        assert speeds.mean() == pytest.approx(SPEED, rel=0.006)
        assert speeds[light].mean() / speeds[heavy].mean() == pytest.approx(ratio, rel=0.01)
        for kind in (light, heavy):
            own = speeds[kind].mean() * math.sqrt(math.pi / 8.0)
            assert stats.kstest(speeds[kind], 'maxwell', args=(0.0, own)).pvalue > 1e-3


def test_a_bead_keeps_its_velocity_when_others_join_and_changes_it_at_each_shake():
    few, many = np.full(10, 1e-6), np.full(1000, 1e-6)
    velocities = maxwellian(few, SPEED, KEY, 0, False)
    np.testing.assert_array_equal(velocities, maxwellian(many, SPEED, KEY, 0, False)[:10])
    assert not np.any(velocities == maxwellian(few, SPEED, KEY, 1, False))
    assert not np.any(velocities == maxwellian(few, SPEED, np.uint64(5), 0, False))


def test_velocities_are_the_same_bits_on_every_machine():
    masses = np.linspace(1.0, 2.0, 100)
    velocities = maxwellian(masses, 0.01, np.uint64(7), 2, True)
    assert (
        hashlib.sha256(velocities.astype('<f8').tobytes()).hexdigest()[:16] == 'aa35a0fcf188f740'
    )


def test_normal_numbers_come_in_pairs_and_say_where_to_go_on():
    a, b, counter = normal_pair(KEY, 0)
    assert counter % 2 == 0
    assert (a, b) != normal_pair(KEY, counter)[:2]
    assert normal_pair(KEY, 0) == (a, b, counter)


def test_a_gas_of_mean_speed_0_is_at_rest():
    assert not maxwellian(np.ones(3), 0.0, KEY, 0, False).any()
