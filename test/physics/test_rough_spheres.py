"""Rough spheres: temperatures of translation and rotation, against limits and simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.rough_spheres import (
    SOLID_SPHERE,
    rms_spin,
    rough_rates,
    rough_temperature_ratio,
    smooth_equivalent,
    temperature_ratio_course,
)
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

ROUGH = [(0.89, -0.5), (0.89, 0.0), (0.7, 0.3), (0.5, 1.0), (1.0, 0.5)]


def test_smooth_beads_have_the_smooth_loss_and_no_rotation():
    rates = rough_rates(0.8, -1.0)
    assert (rates.loss, rates.exchange, rates.drain) == pytest.approx((0.09, 0.0, 0.0))
    assert smooth_equivalent(0.8, -1.0) == pytest.approx(0.8)


def test_perfectly_rough_elastic_beads_reach_equipartition_without_loss():
    rates = rough_rates(1.0, 1.0)
    assert rates.loss == pytest.approx(rates.exchange)
    assert rates.drain == pytest.approx(rates.exchange)
    assert rough_temperature_ratio(1.0, 1.0) == pytest.approx(1.0)
    assert smooth_equivalent(1.0, 1.0) == pytest.approx(1.0)


@pytest.mark.parametrize(('restitution', 'tangential'), ROUGH)
def test_rates_are_means_over_collisions_of_gaussian_beads(restitution, tangential):
    """Drawn collisions with unit temperatures, for each degree of freedom, m = r = 1."""
    random = np.random.default_rng(3)
    n = 400_000
    closing = math.sqrt(2.0) * random.rayleigh(size=n)
    across = math.sqrt(2.0) * random.normal(size=(n, 2))
    turning = math.sqrt(2.0 / SOLID_SPHERE) * random.normal(size=(n, 2))
    # Impulses of a pair: 1/mu = 2 along the normal, 2 + 2/q across it.
    push = (1.0 + tangential) / (2.0 + 2.0 / SOLID_SPHERE) * (across + turning)
    across_after = across - 2.0 * push
    turning_after = turning - 2.0 / SOLID_SPHERE * push
    # Energies of the motion of one against the other, in units of a temperature.
    translation = 0.25 * ((restitution**2 - 1.0) * closing**2)
    translation += 0.25 * ((across_after**2).sum(axis=1) - (across**2).sum(axis=1))
    rotation = 0.25 * SOLID_SPHERE * ((turning_after**2).sum(axis=1) - (turning**2).sum(axis=1))
    rates = rough_rates(restitution, tangential)
    tolerance = 5.0 * translation.std() / math.sqrt(n)
    assert translation.mean() == pytest.approx(4.0 * (rates.exchange - rates.loss), abs=tolerance)
    tolerance = 5.0 * rotation.std() / math.sqrt(n)
    assert rotation.mean() == pytest.approx(4.0 * (rates.exchange - rates.drain), abs=tolerance)


@pytest.mark.parametrize(('restitution', 'tangential'), ROUGH)
def test_the_course_follows_the_rates_and_ends_at_the_ratio(restitution, tangential):
    rates = rough_rates(restitution, tangential)
    at = np.linspace(0.0, 30.0, 3001)
    ratio = temperature_ratio_course(at, restitution, tangential, start=0.2)
    slope = np.gradient(ratio, at)[1:-1]
    inner = ratio[1:-1]
    wanted = rates.exchange - rates.drain * inner
    wanted = 4.0 / 3.0 * (wanted + inner * (rates.loss - rates.exchange * inner))
    np.testing.assert_allclose(slope, wanted, rtol=1e-3, atol=1e-6)
    assert ratio[0] == pytest.approx(0.2)
    end = temperature_ratio_course(np.array([1e6]), restitution, tangential)[0]
    assert end == pytest.approx(rough_temperature_ratio(restitution, tangential))


def test_a_simulated_gas_reaches_the_temperature_ratio_of_the_theory():
    """864 beads, from no rotation; correlations that the theory leaves out cost some per cent."""
    side, cells = 1.0, 6
    corner = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) * 0.5
    places = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing='ij'), axis=-1)
    places = ((places.reshape(-1, 1, 3) + corner).reshape(-1, 3) + 0.25) * side / cells
    n = len(places)
    radius = 0.5 * (0.1 / n) ** (1.0 / 3.0)
    velocities = np.random.default_rng(5).normal(size=(n, 3))
    gas = HardSphereGas(
        Beads(
            radii=np.full(n, radius),
            masses=np.ones(n),
            positions=places,
            velocities=velocities - velocities.mean(axis=0),
        ),
        CollisionRules(
            box=(side,) * 3,
            periodic=(True,) * 3,
            restitution=0.89,
            tangential_restitution=0.5,
            contact_duration=0.0,
        ),
    )
    times = np.linspace(0.0, 8.0, 17)
    course = gas.follow(times[-1], times, times)
    ratio = SOLID_SPHERE * radius**2 * (course.spins**2).mean(axis=(1, 2))
    ratio /= (course.velocities**2).mean(axis=(1, 2))
    collisions = 2.0 * course.observations.pair_collisions / n
    theory = temperature_ratio_course(collisions, 0.89, 0.5)
    assert collisions[-1] > 15.0
    np.testing.assert_allclose(ratio[4:], theory[4:], rtol=0.1)


def test_rough_beads_cool_faster_than_smooth_ones_of_the_same_restitution():
    assert smooth_equivalent(0.89, 0.0) < 0.7
    assert 0.0 < smooth_equivalent(0.0, 0.0) < smooth_equivalent(0.5, 0.0)


def test_a_bead_in_equipartition_turns_some_ninety_degrees_a_second_at_a_millimetre_a_second():
    """Of a bead of 2 mm that flies at 1 mm/s in space: sqrt(5/2) rad/s."""
    rms = math.sqrt(3.0 * math.pi / 8.0)
    projected = 1e-3 * math.pi / 4.0 / rms
    assert rms_spin(projected, 0.002) == pytest.approx(math.sqrt(2.5))
    assert math.degrees(rms_spin(projected, 0.002)) == pytest.approx(90.6, abs=0.1)
    assert rms_spin(projected, 0.002, 0.25) == pytest.approx(0.5 * math.sqrt(2.5))


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (lambda: rough_rates(1.1, 0.0), 'restitution: 1.1'),
        (lambda: rough_rates(0.9, -1.1), 'tangential_restitution: -1.1'),
        (lambda: rough_rates(0.9, math.nan), 'tangential_restitution: nan'),
        (lambda: rough_temperature_ratio(0.9, -1.0), 'smooth beads keep their spin'),
        (lambda: temperature_ratio_course(np.zeros(1), 0.9, 0.0, -1.0), 'start: -1.0'),
        (lambda: rms_spin(0.0, 0.002), 'mean_projected_speed: 0.0'),
        (lambda: rms_spin(0.001, 0.002, math.inf), 'ratio: inf'),
    ],
)
def test_values_outside_their_ranges_are_refused(call, message):
    with pytest.raises(ConfigurationError, match=message):
        call()
