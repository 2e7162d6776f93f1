from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

CONTACTS = slow_contacts(load_trays()[1])


def test_the_contact_rate_per_path_length_is_that_of_the_simulated_tray():
    settings = SimulationSettings(restitution=0.89, wall_restitution=0.97, mean_speed=0.01)
    times = np.linspace(0.0, 20.0, 401)
    runs = cooling_runs(settings, load_trays()[1], times, range(20))
    way = trapezoid(runs.mean_projected_speed, times, axis=1).sum()
    assert CONTACTS.rate == pytest.approx(2.0 * runs.pair_collisions.sum() / (15 * way), rel=0.1)


def test_the_rate_below_an_infinite_speed_is_that_of_all_contacts():
    for measure in ('normal', 'total'):
        assert CONTACTS.rate_below(100.0, measure) == pytest.approx(CONTACTS.rate)


def test_fewer_contacts_are_below_a_total_speed_than_below_a_normal_speed():
    speeds = np.geomspace(1e-5, 3.0, 60)
    normal, total = (CONTACTS.rate_below(speeds, measure) for measure in ('normal', 'total'))
    assert (np.diff(normal) > 0.0).all()
    assert (np.diff(total) > 0.0).all()
    assert (total < normal).all()
    assert normal[1] / normal[0] == pytest.approx((speeds[1] / speeds[0]) ** 2, rel=1e-4)
    assert total[1] / total[0] == pytest.approx((speeds[1] / speeds[0]) ** 4, rel=1e-4)


def test_contacts_of_an_isotropic_gas_are_those_of_the_closed_form():
    variance = np.full(1, 0.4)
    single = replace(CONTACTS, rates=np.ones(1), normal=variance, tangential=variance)
    speed = 0.7
    x = speed**2 / (2.0 * 0.4)
    assert single.rate_below(speed) == pytest.approx(1.0 - np.exp(-x))
    assert single.rate_below(speed, 'total') == pytest.approx(
        1.0 - (1.0 + x) * np.exp(-x), rel=2e-3
    )


def test_another_measure_is_refused():
    with pytest.raises(ConfigurationError, match='tangential'):
        CONTACTS.rate_below(1.0, 'tangential')


@pytest.mark.parametrize('measure', ['normal', 'total'])
def test_the_interpolated_rate_equals_the_exact_rate(measure):
    contacts = slow_contacts(load_trays()[3])
    speeds = np.geomspace(1e-3, 30.0, 97)
    for _ in range(2):
        interpolated = contacts.interpolated_rate_below(speeds, measure)
        np.testing.assert_allclose(interpolated, contacts.rate_below(speeds, measure), rtol=1e-3)


@pytest.mark.parametrize('measure', ['normal', 'total'])
def test_sums_over_mean_speeds_equal_sums_of_single_rates(measure):
    speeds, means = np.geomspace(1e-9, 10.0, 40), np.geomspace(1e-4, 1e-2, 7)
    weights = np.linspace(0.5, 2.0, 7)
    slower = CONTACTS.interpolated_rate_below(speeds[:, np.newaxis] / means, measure)
    sums = CONTACTS.summed_rate_below(speeds, means, weights, measure)
    np.testing.assert_allclose(sums, slower @ weights, rtol=1e-11)
    logs = CONTACTS.summed_log_rate_below(speeds, means, measure)
    np.testing.assert_allclose(logs, np.log(slower).sum(axis=1), rtol=1e-11)
