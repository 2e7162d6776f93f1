"""Beads and ledger together conserve energy, momentum and angular momentum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gases import (
    ALL_RULES,
    KERNELS,
    NEVER,
    TURNING,
    angular_momentum,
    energy,
    mixture,
    momentum,
    smallest_gap,
)

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

BOX = (12.0, 11.0, 10.0)
BEADS = 40
TIMES = np.linspace(0.0, 40.0, 9)
PRECISION = 1e-12

MOMENTUM = slice(9, 12)
TO_WALLS, TO_AGGREGATES = slice(12, 15), slice(15, 18)


def gas_and_rules(name, kernel, seed=1):
    rules = CollisionRules(box=BOX, **ALL_RULES[name])
    return HardSphereGas(mixture(seed, BEADS, rules), rules, kernel), rules


def states(gas):
    """The gas at each time."""
    for time in TIMES:
        gas.run_until(time)
        yield replace(gas.beads(), spins=gas.spins)


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', ALL_RULES)
def test_energy_and_momentum_of_beads_and_ledger_are_conserved(name, kernel):
    gas, rules = gas_and_rules(name, kernel)
    start = gas.beads()
    energy_before, momentum_before = energy(start), momentum(start)
    scale = np.sum(start.masses * np.linalg.norm(start.velocities, axis=1))
    for beads in states(gas):
        exchanged = max(energy_before, np.abs(gas.ledger[:3]).sum())
        assert abs(energy(beads) + gas.ledger[:3].sum() - energy_before) <= PRECISION * exchanged
        given = np.abs(gas.ledger[3:12]).max()
        total = momentum(beads) + gas.ledger[MOMENTUM]
        assert np.abs(total - momentum_before).max() <= PRECISION * max(scale, given)
    assert gas.counts.pair > 100
    assert (gas.counts.wall > 100) == (not all(rules.periodic))
    assert (gas.counts.merge > 0) == (rules.sticking_speed > 0)
    assert (gas.counts.fix > 0) == (rules.wall_sticking_speed > 0)


BOOKED = [
    name
    for name, rule in ALL_RULES.items()
    if rule.get('periodic', NEVER) == NEVER
    and ('sticking_speed' in rule or 'tangential_restitution' in rule)
]


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', BOOKED)
def test_angular_momentum_of_rough_and_sticky_beads_and_ledger_is_conserved(name, kernel):
    gas, rules = gas_and_rules(name, kernel)
    start = gas.beads()
    turned = angular_momentum(start)
    scale = np.sum(start.masses * np.linalg.norm(start.velocities, axis=1)) * max(BOX)
    for beads in states(gas):
        given = max(scale, np.abs(gas.ledger[3:]).max() * max(BOX))
        total = angular_momentum(beads) + gas.ledger[TO_WALLS] + gas.ledger[TO_AGGREGATES]
        assert np.abs(total - turned).max() <= PRECISION * given
    assert np.abs(gas.ledger[TO_WALLS]).max() > 1.0
    turning = name in TURNING or rules.sticking_speed == 0.0
    assert (np.abs(gas.ledger[TO_AGGREGATES]).max() > 0.01) == (not turning)


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('rough', [False, True])
def test_energy_drifts_by_rounding_alone_over_tens_of_thousands_of_elastic_events(kernel, rough):
    spinning = {'tangential_restitution': 1.0, 'wall_tangential_restitution': 1.0}
    rules = CollisionRules(box=BOX, **(spinning if rough else {}))
    gas = HardSphereGas(mixture(2, BEADS, rules), rules, kernel)
    energy_before = energy(gas.beads())
    gas.run_until(600.0)
    assert gas.counts.pair + gas.counts.wall > 15_000
    assert abs(energy(gas.beads()) / energy_before - 1.0) <= PRECISION
    assert smallest_gap(gas.beads().positions, gas.radii, rules) > -1e-10


@pytest.mark.parametrize('kernel', KERNELS)
def test_momentum_given_to_walls_is_that_of_the_reversed_normal_velocities(kernel):
    """Between elastic walls alone, one bead: each bounce gives 2 m |v|."""
    rules = CollisionRules(box=BOX)
    beads = mixture(3, 1, rules)
    gas = HardSphereGas(beads, rules, kernel)
    events = gas.follow(3000.0, log=True).events
    for wall in range(6):
        bounces = np.sum(events['partner'] == wall)
        push = 2 * beads.masses[0] * abs(beads.velocities[0, wall // 2])
        assert bounces > 5
        assert gas.ledger[3 + wall] == pytest.approx(bounces * push, rel=PRECISION)


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_shaken_tray_gains_what_its_walls_give(kernel):
    gas, _ = gas_and_rules('shaken', kernel)
    energy_before = energy(gas.beads())
    gas.run_until(5.0)
    assert gas.ledger[1] < 0.0
    assert energy(gas.beads()) > energy_before
