from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.chance_proximity import (
    chance_probability,
    encounter_rate,
    expected_encounters,
    max_chance_probability,
)


def test_free_beads_are_less_likely_to_stay_together_over_a_longer_path():
    probability = chance_probability(
        np.array([0.0, 1e-3, 2e-3, 4e-3]), 2e-5, encounter_rate(load_trays()[1])
    )
    assert probability[0] == 1.0
    assert (np.diff(probability) < 0.0).all()


def test_the_chance_probability_is_not_below_that_of_free_gaussian_velocities():
    rng = np.random.default_rng(1)
    way, half = 4e-4, 2e-5
    apart = rng.normal(0.0, way, (400_000, 2))
    stayed = np.mean((np.abs(apart) < 2.0 * half).all(axis=1))
    assert chance_probability(way, half, 0.0) == pytest.approx(7.0 * stayed, rel=0.1)


def test_the_false_alarm_rate_is_divided_among_all_encounters_of_a_cycle():
    tray = load_trays()[3]
    assert max_chance_probability(tray, 0.01) * expected_encounters(tray) == pytest.approx(0.01)


@pytest.mark.parametrize('rate', [0.0, 1.0, float('nan')])
def test_a_false_alarm_rate_outside_0_to_1_is_refused(rate):
    with pytest.raises(ConfigurationError, match='false_alarm_rate'):
        max_chance_probability(load_trays()[1], rate)
