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


def test_free_beads_are_the_less_likely_to_stay_the_further_they_would_have_gone():
    probability = chance_probability(
        np.array([0.0, 1e-3, 2e-3, 4e-3]), 2e-5, encounter_rate(load_trays()[1])
    )
    assert probability[0] == 1.0
    assert (np.diff(probability) < 0.0).all()


def test_the_chance_is_not_below_that_of_gaussian_velocities_that_nothing_disturbs():
    rng = np.random.default_rng(1)
    way, half = 4e-4, 2e-5
    apart = rng.normal(0.0, way, (400_000, 2))
    stayed = np.mean((np.abs(apart) < 2.0 * half).all(axis=1))
    assert chance_probability(way, half, 0.0) == pytest.approx(7.0 * stayed, rel=0.1)


def test_false_alarm_rate_are_shared_out_among_all_encounters_of_a_cycle():
    tray = load_trays()[3]
    assert max_chance_probability(tray, 0.01) * expected_encounters(tray) == pytest.approx(0.01)


@pytest.mark.parametrize('rate', [0.0, 1.0, float('nan')])
def test_a_rate_of_false_alarm_rate_that_is_none_is_refused(rate):
    with pytest.raises(ConfigurationError, match='false_alarm_rate'):
        max_chance_probability(load_trays()[1], rate)
