"""Whether restitutions depend on the impact speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_rebound

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.cycle_likelihoods import MeanRestitution
from nanorocks_ros.inference.flights.flight_losses import flight_losses, flight_table
from nanorocks_ros.inference.likelihood_1d import Posterior1D
from nanorocks_ros.inference.speed_dependence import (
    RunningDependence,
    SpeedDependence,
    speed_dependence,
)
from nanorocks_ros.records import Measured
from nanorocks_ros.settings import PriorSettings
from nanorocks_ros.stages.restitution.cycle_restitution import CycleRestitution

ENDS = np.array([0.025, 0.5, 0.975])
NARROW = np.array([0.16, 0.5, 0.84])
PRIOR = PriorSettings()
NO_FLIGHTS = flight_losses(flight_table(()), Measured(0.0, 0.0))


def terms(n, exponent, seed=1):
    rng = np.random.default_rng(seed)
    speeds = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), n))
    noise = rng.normal(0.0, 0.01, (n, 2))
    return ContactTerms.of(
        drawn_rebound(
            speed * (1.0 + change[0]),
            speed * (1.0 - 0.1 * (speed / 3e-3) ** exponent + change[1]),
            0.01 * speed,
        )
        for speed, change in zip(speeds, noise, strict=True)
    )


def test_a_constant_restitution_does_not_depend_and_a_falling_one_does():
    constant = speed_dependence(terms(100, 0.0), NO_FLIGHTS, PRIOR)
    falling = speed_dependence(terms(100, 0.5), NO_FLIGHTS, PRIOR)
    assert not constant.is_seen
    assert falling.is_seen
    assert falling.beads is None
    assert not SpeedDependence().is_seen


@pytest.mark.parametrize('kind', [CycleRestitution, MeanRestitution])
def test_the_fields_are_those_of_the_results(kind):
    fields = speed_dependence(terms(100, 0.5), NO_FLIGHTS, PRIOR).fields(ENDS, NARROW)
    more = {'cycles': 1, 'restitution': None} if kind is MeanRestitution else {}
    result = kind(**more, **fields)
    assert result.speed_dependent
    assert 0.0 < result.wall_restitution_exponent.lower < 0.5
    exponent = result.wall_restitution_exponent
    narrow = result.wall_restitution_exponent_lower_68, result.wall_restitution_exponent_upper_68
    assert exponent.lower < narrow[0] < exponent.value < narrow[1] < exponent.upper
    assert 1e-3 < result.wall_impact_speed < 1e-2
    assert np.isnan(result.restitution_exponent.value)
    assert np.isnan(result.impact_speed)
    assert np.isnan(result.impact_restitution.value)
    at_speed = result.wall_impact_restitution
    truth = 1.0 - 0.1 * (result.wall_impact_speed / 3e-3) ** 0.5
    assert at_speed.lower < truth < at_speed.upper < at_speed.lower + 0.05


def test_while_a_cycle_cools_a_tenth_more_contacts_are_awaited():
    running = RunningDependence()

    def of(n, *, final=False):
        dependence = running.of(terms(n, 0.5), NO_FLIGHTS, PRIOR, final=final)
        return dependence.walls.contacts if dependence.walls else 0

    assert of(10) == 0
    assert [of(n) for n in (40, 43, 44, 48)] == [40, 40, 44, 44]
    assert of(48, final=True) == 48
    assert of(30) == 30


def exponent(mean, deviation):
    """An exponent with a Gaussian posterior."""
    axis = np.linspace(-1.0, 2.0, 3001)
    weight = np.exp(-0.5 * ((axis - mean) / deviation) ** 2)
    return replace(
        terms(100, 0.5).wall_exponent(),
        exponent=Posterior1D(restitution=axis, probability=weight / weight.sum()),
    )


def test_a_law_counts_the_more_the_less_likely_a_constant_restitution_is():
    weights = [
        SpeedDependence(beads=exponent(mean, 0.15)).bead_weight
        for mean in (-0.2, 0.0, 0.1, 0.2, 0.25, 0.4)
    ]
    assert 0.05 < weights[0] < weights[1] < weights[2] < weights[3] < weights[4] < 0.8
    assert weights[5] == 1.0
    assert SpeedDependence().bead_weight == 0.0


def test_a_law_that_is_not_certain_is_one_of_known_materials():
    uncertain, certain = (
        SpeedDependence(beads=exponent(mean, 0.15)).bead_law for mean in (0.2, 0.4)
    )
    assert 0.0 <= uncertain.exponents.min() <= uncertain.exponents.max() <= 0.75
    assert uncertain.probabilities.sum() == pytest.approx(1.0)
    assert certain is not None
    assert SpeedDependence().bead_law is None


def test_walls_follow_their_law_where_it_is_certain():
    assert SpeedDependence(walls=exponent(0.4, 0.15)).wall_weight == 1.0
    assert SpeedDependence(walls=exponent(0.2, 0.15)).wall_weight == 0.0
    assert SpeedDependence().wall_weight == 0.0


def test_the_probability_of_a_law_follows_from_the_density_of_its_exponent_at_0():
    # Half of a Gaussian from 0 on.
    density = 2.0 / (0.2 * math.sqrt(2.0 * math.pi))
    assert exponent(0.0, 0.2).law_probability(0.75) == pytest.approx(
        1.0 / (1.0 + 0.75 * density), abs=0.01
    )
    assert exponent(-0.9, 0.01).law_probability(0.75) == 0.0
