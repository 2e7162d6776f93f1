"""Steady state and energy balance of a tray that is shaken without end."""

from functools import cache

import numpy as np
import pytest

from benchmarks.hard_sphere_runs import over_runs, shaken_tray

RUNS = range(12)
# Periods until the beads, at rest but for 2 % of their energy, have caught up; they need 7.
START = 50


@cache
def shaken(seed):
    """600 periods, 120 s."""
    return shaken_tray(seed)


def quarters(seed):
    """Mean energy in each quarter of the time after the start."""
    energy, _, _ = shaken(seed)
    return [float(part.mean()) for part in np.array_split(energy[START:], 4)]


@pytest.mark.parametrize('later', [1, 2, 3])
def test_energy_of_a_shaken_tray_becomes_steady(later):
    # There is no published value: this is what a steady state means. Tolerance: four errors of
    # the difference between quarters of independent runs, 1 % each.
    change = over_runs(lambda seed: np.log(quarters(seed)[later] / quarters(seed)[0]), RUNS)
    assert change.error < 0.015
    assert change.mean == pytest.approx(0.0, abs=4.0 * change.error)


def test_walls_give_what_beads_lose_to_one_another():
    # The books close at every period, to rounding. What the beads hold is lost 400 times over
    # in this time, so that the sums must agree to 1/400 and better.
    for seed in RUNS:
        energy, lost, gained = shaken(seed)
        np.testing.assert_allclose(energy - energy[0], gained - lost, atol=1e-11 * gained[-1])
        ratio = (gained[-1] - gained[START]) / (lost[-1] - lost[START])
        assert ratio == pytest.approx(1.0, abs=0.005)


def test_twice_the_frequency_gives_four_times_the_energy():
    # Hard spheres have no time of their own: energy goes with the square of the frequency.
    # Only the contact duration is one, and hardly a contact in a thousand is so short. Tolerance:
    # four errors of these runs.
    slow = over_runs(lambda seed: np.mean(quarters(seed)), RUNS)
    fast = over_runs(
        lambda seed: np.mean(shaken_tray(seed, frequency=10.0, duration=60.0)[0][START:]), RUNS
    )
    error = np.hypot(slow.error / slow.mean, fast.error / fast.mean)
    assert error < 0.015
    assert fast.mean / slow.mean == pytest.approx(4.0, rel=4.0 * error)
