"""Kinetic theory without walls, against published values."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as some

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.physics.error_propagation import Estimate
from nanorocks_ros.physics.kinetic_theory import (
    contact_value,
    filling_factor,
    kinetic_decay_rate,
    kinetic_haff_time,
    kinetic_restitution,
)

# A bead of 2 mm; 15 of them in 15 x 15 x 3 mm.
DIAMETER, DENSITY = 0.002, 15 / 675e-9


@pytest.mark.parametrize(
    ('filling', 'published'),
    [(0.01, 1.0254571), (0.05, 1.1371920), (0.1, 1.3031550), (0.2, 1.7578125), (0.4, 3.7037037)],
)
def test_the_contact_value_is_that_of_carnahan_and_starling(filling, published):
    assert contact_value(filling) == pytest.approx(published, abs=1e-6)


def collision_rate(mean_speed, diameter, number_density):
    """Collisions of one bead per second by Enskog, [1/s]; Chapman, Cowling 1970, chapter 16."""
    crowding = contact_value(filling_factor(diameter, number_density))
    return math.sqrt(2.0) * math.pi * diameter**2 * number_density * crowding * mean_speed


def test_the_mean_free_time_is_the_published_one():
    # 0.13031 in units of d sqrt(m/kT) at n d^3 = 0.5, molecular dynamics: Lue 2005,
    # doi:10.1063/1.1834498; 0.3 % is what the contact value lacks there.
    thermal = 0.01
    rate = collision_rate(math.sqrt(8.0 / math.pi) * thermal, DIAMETER, 0.5 / DIAMETER**3)
    assert 1.0 / rate * thermal / DIAMETER == pytest.approx(0.13031, rel=0.004)


def test_the_decay_has_the_coefficient_of_haffs_law():
    # 1/tau = sqrt(2)/6 (1 - e^2) sigma n g <v>, <v> in space: 0.2357.
    crowding = contact_value(filling_factor(DIAMETER, DENSITY))
    rate = kinetic_decay_rate(0.9, DIAMETER, DENSITY)
    in_space = rate * math.pi / 4.0 / (math.pi * DIAMETER**2 * DENSITY * crowding)
    assert in_space / (1.0 - 0.81) == pytest.approx(0.2357, abs=1e-4)


def test_beads_lose_a_sixth_of_their_loss_in_each_collision():
    # 1/tau = omega (1 - e^2) / 6, whatever the density.
    speed = 0.005
    time = kinetic_haff_time(speed, 0.8, DIAMETER, DENSITY)
    rate = collision_rate(speed * 4.0 / math.pi, DIAMETER, DENSITY)
    assert 1.0 / time == pytest.approx(rate * (1.0 - 0.64) / 6.0)


@given(some.floats(0.0, 0.999))
def test_the_restitution_undoes_the_decay(restitution):
    rate = kinetic_decay_rate(restitution, DIAMETER, DENSITY)
    undone = kinetic_restitution(rate, DIAMETER, DENSITY).value
    assert undone == pytest.approx(restitution, abs=1e-7)


def test_errors_are_those_of_the_formula():
    # e^2 = 1 - beta/k, so de = dbeta / (2 k e).
    rate = kinetic_decay_rate(0.9, DIAMETER, DENSITY)
    estimate = kinetic_restitution(Estimate(value=rate, error=0.05 * rate), DIAMETER, DENSITY)
    assert estimate.error == pytest.approx(0.05 * (1.0 - 0.81) / (2.0 * 0.9), rel=1e-4)


def test_an_elastic_gas_does_not_cool():
    assert kinetic_haff_time(0.01, 1.0, DIAMETER, DENSITY) == math.inf


def test_a_decay_faster_than_beads_can_make_is_an_error():
    with pytest.raises(FitError, match='walls take part'):
        kinetic_restitution(1e4, DIAMETER, DENSITY)


@pytest.mark.parametrize('bad', [-0.1, 1.1, math.nan])
def test_a_restitution_outside_0_to_1_is_refused(bad):
    with pytest.raises(ConfigurationError, match='from 0 to 1'):
        kinetic_decay_rate(bad, DIAMETER, DENSITY)


def test_a_gas_denser_than_a_fluid_is_refused():
    with pytest.raises(ConfigurationError, match='freeze'):
        kinetic_decay_rate(0.9, DIAMETER, 1.0 / DIAMETER**3)
