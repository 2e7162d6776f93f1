from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.chance_proximity import (
    CollisionRate,
    chance_probability,
    expected_encounters,
    first_merge_path,
    max_chance_probability,
    parting_rate,
    parting_share,
    turning_chance_probability,
)


def test_free_beads_are_less_likely_to_stay_together_over_a_longer_path():
    probability = chance_probability(
        np.array([0.0, 1e-3, 2e-3, 4e-3]), 2e-5, parting_rate(load_trays()[1])
    )
    assert probability[0] == 1.0
    assert (np.diff(probability) < 0.0).all()


def test_the_chance_probability_is_not_below_that_of_free_gaussian_velocities():
    rng = np.random.default_rng(1)
    way, half = 4e-4, 2e-5
    apart = rng.normal(0.0, way, (400_000, 2))
    stayed = np.mean((np.abs(apart) < 2.0 * half).all(axis=1))
    assert chance_probability(way, half, 0.0) == pytest.approx(7.0 * stayed, rel=0.1)


@pytest.mark.parametrize(('nearest', 'farthest'), [(1.9e-3, 2.05e-3), (1.5e-3, 2e-3), (0.0, 1e-3)])
def test_the_turning_probability_is_not_below_that_of_free_straight_lines(nearest, farthest):
    rng = np.random.default_rng(2)
    path, n = 5e-3, 1_000_000
    # Lines that begin at the outer edge, sampled along their way.
    way = rng.normal(0.0, path, (n, 2))
    way = way[np.hypot(*way.T) < 2.0 * farthest]
    shares = np.linspace(0.0, 1.0, 25)[:, None]
    distances = np.hypot(farthest + shares * way[:, 0], shares * way[:, 1])
    stayed = ((distances >= nearest) & (distances <= farthest)).all(axis=0).sum() / n
    probability = float(turning_chance_probability(path, nearest, farthest, 0.0))
    # 7 for slow pairs, which are more frequent than Gaussian velocities say.
    assert 7.0 * stayed < probability < 7.0 * 4.0 * stayed


def test_a_bead_collides_more_often_if_it_is_larger_and_the_lid_is_lower():
    tray = load_trays()[3]
    flat = replace(tray, dimensions=(*tray.dimensions[:2], 2.1e-3))
    small, large = CollisionRate(tray)(np.array([5e-4, 1e-3]), np.ones(2))
    assert large > 1.5 * small
    assert CollisionRate(flat)(np.array([5e-4]), np.ones(1))[0] > small


def test_in_one_layer_a_bead_sweeps_twice_the_sum_of_the_radii():
    tray = load_trays()[1]
    layer = replace(tray, dimensions=(*tray.dimensions[:2], tray.diameter))
    rate = CollisionRate(layer)(np.array([1e-3]), np.ones(1))[0]
    # 14 others, sides less a diameter of 13 mm, mean relative speed (pi / 2)^(1/2).
    assert rate == pytest.approx(np.sqrt(0.5 * np.pi) * 14 * 4e-3 / 13e-3**2, rel=1e-6)


def test_collisions_part_fewer_pairs_where_beads_cover_more_of_the_floor():
    trays = load_trays()
    assert parting_share(trays[5]) < 0.7 * parting_share(trays[3])
    assert parting_share(trays[3]) == pytest.approx(parting_share(trays[1]), rel=0.01)


def test_the_false_alarm_rate_is_divided_among_all_encounters_of_a_cycle():
    tray = load_trays()[3]
    assert max_chance_probability(tray, 0.01) * expected_encounters(tray) == pytest.approx(0.01)


@pytest.mark.parametrize('rate', [0.0, 1.0, float('nan')])
def test_a_false_alarm_rate_outside_0_to_1_is_refused(rate):
    with pytest.raises(ConfigurationError, match='false_alarm_rate'):
        max_chance_probability(load_trays()[1], rate)


def test_a_first_merge_needs_the_path_in_which_free_beads_would_have_parted():
    needed = [first_merge_path(load_trays()[1], rate) for rate in (0.1, 0.01, 0.001)]
    assert needed[0] < needed[1] < needed[2]
    # Of equal beads the relative path is 2/pi^(1/2) times that at the mean projected speed.
    tray = load_trays()[1]
    paths = 2.0 / math.sqrt(math.pi) * needed[1] * np.array([0.99, 1.01])
    parting = parting_share(tray) * CollisionRate(tray)(
        np.array([0.5 * tray.species[0].diameter]), np.array([2.0])
    )
    diameter = tray.species[0].diameter
    before, after = turning_chance_probability(paths, 0.7 * diameter, diameter, parting)
    assert before > max_chance_probability(tray, 0.01) > after


def test_a_first_merge_of_a_mixture_needs_the_path_of_its_slow_pairs():
    equal, mixed = (first_merge_path(load_trays()[number], 0.01) for number in (1, 3))
    assert mixed > equal
