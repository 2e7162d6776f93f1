"""Laws of restitution: by species, drawn at random, falling with speed, above one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gases import BOX, KERNELS, energy, gas_of, mixture, near

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    PowerLawRestitution,
    UniformRestitution,
    ViscoelasticRestitution,
)

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


def restitutions(events, masses):
    """What each pair collision of smooth beads left of the normal speed, from its impulse."""
    pairs = events[events['kind'] == 'pair']
    mass, partner_mass = masses[pairs['bead']], masses[pairs['partner']]
    reduced = mass * partner_mass / (mass + partner_mass)
    return pairs['impulse'] / (reduced * pairs['normal_speed']) - 1.0


def rebound(kernel, restitution, speed=2.0, **more):
    """Part of the speed that is left of a head-on collision."""
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(speed / 2, 0, 0), (-speed / 2, 0, 0)],
        restitution=restitution,
        kernel=kernel,
        **more,
    )
    v = gas.follow(3.0 / speed, [3.0 / speed]).velocities[0, :, 0]
    assert gas.counts.pair == 1
    return (v[1] - v[0]) / speed


def test_each_pair_of_species_has_its_own_restitution(kernel):
    table = [[0.1, 0.4, 0.3], [0.4, 0.9, 0.2], [0.3, 0.2, 0.7]]
    for a in range(3):
        for b in range(3):
            species = np.array([a, b])
            assert rebound(kernel, table, species=species) == near(table[a][b])


def test_an_array_of_a_table_and_one_number_for_all_are_the_same(kernel):
    rules = CollisionRules(box=BOX, restitution=0.7)
    beads = replace(mixture(1, 8, rules), species=np.arange(8) % 3)
    table = replace(rules, restitution=np.full((3, 3), 0.7))
    by_number, by_table = (
        HardSphereGas(beads, law, kernel).follow(9.0, [9.0]) for law in (rules, table)
    )
    np.testing.assert_array_equal(by_number.positions, by_table.positions)


def test_a_random_restitution_is_uniform_in_its_range(kernel):
    law = UniformRestitution(mean=0.95, width=0.1)
    rules = CollisionRules(box=BOX, restitution=law, wall_restitution=1.02, allow_gain=True)
    beads = mixture(1, 12, rules)
    events = HardSphereGas(beads, rules, kernel).follow(800.0, log=True).events
    drawn = restitutions(events, beads.masses)
    n = drawn.size
    assert n > 1500
    assert drawn.min() >= 0.9 - 1e-9
    assert drawn.max() <= 1.0 + 1e-9
    assert drawn.mean() == pytest.approx(0.95, abs=4 * 0.1 / math.sqrt(12 * n))
    assert drawn.std() == pytest.approx(0.1 / math.sqrt(12), rel=0.05)
    counts, _ = np.histogram(drawn, 10, (0.9, 1.0))
    # Chi squared of nine degrees of freedom: above 27.9 once in a thousand.
    assert np.sum((counts - n / 10) ** 2 / (n / 10)) < 27.9
    # Nothing of the one before is in the next.
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 4 / math.sqrt(n)


def test_a_random_restitution_of_width_0_is_its_mean(kernel):
    assert rebound(kernel, UniformRestitution(mean=0.6, width=0.0)) == near(0.6)


def test_random_restitutions_depend_on_the_seed_not_on_the_kernel(kernel):
    def first(seed, kernel):
        rules = CollisionRules(
            box=BOX, restitution=UniformRestitution(mean=0.7, width=0.6), seed=seed
        )
        beads = mixture(1, 12, rules)
        events = HardSphereGas(beads, rules, kernel).follow(20.0, log=True).events
        return restitutions(events, beads.masses)[:20]

    values = first(1, kernel)
    for other in KERNELS:
        np.testing.assert_allclose(first(1, other), values, atol=1e-6)
    assert np.abs(first(2, kernel) - values).max() > 0.1


def test_a_kick_does_not_repeat_random_restitutions(kernel):
    law = UniformRestitution(mean=0.5, width=0.8)
    gas = gas_of([(3, 5, 5), (7, 5, 5)], [(1, 0, 0), (-1, 0, 0)], restitution=law, kernel=kernel)
    seen = []
    for _ in range(4):
        v = gas.follow(1.2, [1.2]).velocities[0, :, 0]
        seen.append((v[1] - v[0]) / 2)
        back = np.array([3, 7]) - gas.beads().positions[:, 0]
        gas.kick([(back[0], 0, 0), (back[1], 0, 0)])
        gas.run_until(1.0)
        gas.kick([(1, 0, 0), (-1, 0, 0)])
    assert len(set(np.round(seen, 6))) == 4


def pade(z):
    """Müller, Pöschel 2011, Phys. Rev. E 84, 021302, equation 15, digits as printed."""
    over = 1.0 + 0.501086 * z
    return over / (over + 1.15345 * z**2 + 0.577977 * z**3 + 0.532178 * z**4)


@pytest.mark.parametrize('value', [0.2, 0.6, 0.9])
def test_a_viscoelastic_restitution_is_the_published_function_of_speed(kernel, value):
    law = ViscoelasticRestitution(value=value, at_speed=0.5)
    assert rebound(kernel, law, speed=0.5) == near(value)
    # The argument that has the value, by a plain search; it goes with speed^(1/10).
    z = np.linspace(0.0, 20.0, 2_000_001)
    at = np.interp(-value, -pade(z), z)
    for speed in (1e-6, 1e-3, 0.1, 2.0, 50.0):
        expected = pade(at * (speed / 0.5) ** 0.1)
        assert rebound(kernel, law, speed=speed) == pytest.approx(expected, abs=1e-9)


def test_a_viscoelastic_restitution_falls_with_speed_from_1(kernel):
    law = ViscoelasticRestitution(value=0.8, at_speed=1.0)
    speeds = [1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3]
    restitution_values = [rebound(kernel, law, speed=speed) for speed in speeds]
    assert np.all(np.diff(restitution_values) < 0.0)
    # Leading orders of the theory: 1 - 1.15344 z² + ..., with z² going as speed^(1/5).
    weak = ViscoelasticRestitution(value=0.9999, at_speed=1.0)
    losses = [1.0 - rebound(kernel, weak, speed=speed) for speed in (1.0, 32.0)]
    assert losses[1] / losses[0] == pytest.approx(2.0, rel=0.02)
    assert 1.0 - restitution_values[0] < 0.01


def test_a_gas_of_viscoelastic_beads_becomes_more_elastic_as_it_cools(kernel):
    rules = CollisionRules(box=BOX, restitution=ViscoelasticRestitution(value=0.7, at_speed=2.0))
    beads = mixture(1, 12, rules)
    gas = HardSphereGas(beads, rules, kernel)
    restitution_values = restitutions(gas.follow(200.0, log=True).events, beads.masses)
    assert restitution_values[-50:].mean() > restitution_values[:50].mean() + 0.03


@pytest.mark.parametrize('exponent', [0.0, 0.2, 0.6])
def test_a_loss_goes_with_a_power_of_speed_and_is_1_at_most(kernel, exponent):
    law = PowerLawRestitution(value=0.9, at_speed=0.5, exponent=exponent)
    for speed in (1e-3, 0.5, 20.0, 1e9):
        expected = max(1.0 - 0.1 * (speed / 0.5) ** exponent, 0.0)
        assert rebound(kernel, law, speed=speed) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    'law',
    [
        PowerLawRestitution(value=0.8, at_speed=0.7, exponent=0.5),
        ViscoelasticRestitution(value=0.8, at_speed=0.7),
    ],
)
def test_walls_follow_the_laws_of_beads(kernel, law):
    for speed in (0.1, 0.7, 3.0):
        gas = gas_of([(5, 5, 5)], [(speed, 0, 0)], wall_restitution=law, kernel=kernel)
        gas.run_until(6.0 / speed)
        kept = -gas.beads().velocities[0, 0] / speed
        assert kept == pytest.approx(rebound(kernel, law, speed=speed), abs=1e-9)
        assert gas.counts.wall == 1


def test_each_wall_may_have_its_own_value_of_a_law(kernel):
    laws = [
        PowerLawRestitution(value=value, at_speed=1.0, exponent=0.5)
        for value in (0.9, 0.5, 0.9, 0.9, 0.9, 0.9)
    ]
    gas = gas_of([(5, 5, 5)], [(1.0, 0, 0)], wall_restitution=laws, kernel=kernel)
    gas.run_until(6.0)
    assert gas.beads().velocities[0, 0] == pytest.approx(-0.5, abs=1e-12)


def test_an_exponent_of_0_is_a_constant_restitution(kernel):
    rules = CollisionRules(box=BOX, restitution=0.7, wall_restitution=0.9)
    law = replace(
        rules,
        restitution=PowerLawRestitution(value=0.7, at_speed=1.0, exponent=0.0),
        wall_restitution=PowerLawRestitution(value=0.9, at_speed=1.0, exponent=0.0),
    )
    beads = mixture(1, 8, rules)
    constant, power = (
        HardSphereGas(beads, each, kernel).follow(3.0, [3.0]) for each in (rules, law)
    )
    np.testing.assert_allclose(constant.positions, power.positions, rtol=1e-6)


@pytest.mark.parametrize('rule', ['restitution', 'wall_restitution'])
def test_a_restitution_above_1_heats_the_gas(kernel, rule):
    rules = CollisionRules(box=BOX, allow_gain=True, **{rule: 1.05})
    gas = HardSphereGas(mixture(1, 8, rules), rules, kernel)
    energy_before = energy(gas.beads())
    gas.run_until(10.0)
    assert energy(gas.beads()) > 1.2 * energy_before
    assert gas.ledger[:3].sum() == pytest.approx(energy_before - energy(gas.beads()), rel=1e-12)


def test_walls_may_have_another_restitution_than_beads(kernel):
    rules = CollisionRules(box=BOX, restitution=0.5, wall_restitution=1.0)
    gas = HardSphereGas(mixture(1, 10, rules), rules, kernel)
    gas.run_until(10.0)
    assert gas.counts.wall > 20
    assert gas.ledger[0] > 0.0
    assert abs(gas.ledger[1]) < 1e-12
