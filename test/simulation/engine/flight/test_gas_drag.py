"""Drag of a gas: free flight, and the change of clock of equal beads, are exact."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gases import BOX, KERNELS, RULES, energy, gas_of, mixture, near, smallest_gap
from hypothesis import given, settings
from hypothesis import strategies as st
from stepped_gas import SteppedGas

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import Kernel
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

RATE = 0.3


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_free_bead_loses_momentum_energy_and_spin_as_stokes_says(kernel):
    gas = gas_of(
        [(5, 5, 5)],
        [(0.5, -0.2, 0.1)],
        spins=[(1, 2, 3)],
        drag=np.array([RATE]),
        tangential_restitution=0.5,
        kernel=kernel,
    )
    before = gas.beads()
    times = np.array([0.0, 1.0, 7.5, 40.0])
    record = gas.follow(40.0, times, times)
    left = np.exp(-RATE * times)
    path = (1.0 - left)[:, np.newaxis] / RATE * before.velocities
    assert record.positions[:, 0] == near(before.positions + path)
    assert record.velocities[:, 0] == near(left[:, np.newaxis] * before.velocities)
    spun = np.exp(-10.0 / 3.0 * RATE * times)[:, np.newaxis]
    assert record.spins[:, 0] == near(spun * before.spins)
    assert record.observations.mean_speed == near(left * math.sqrt(0.3))
    squares = np.array([0.25, 0.04, 0.01])
    assert record.observations.granular_temperature[:, 0] == near(np.outer(left**2, squares))


def test_a_bead_stops_before_a_wall_that_is_out_of_reach():
    """It flies 1 / rate times its speed, whatever the time."""
    gas = gas_of([(5, 5, 5)], [(1, 0, 0)], drag=np.array([0.251]))
    assert gas.follow(1e6, log=True).events.size == 0
    assert gas.beads().positions[0] == near([5 + 1 / 0.251, 5, 5])
    gas = gas_of([(5, 5, 5)], [(1, 0, 0)], drag=np.array([0.249]))
    events = gas.follow(1e6, log=True).events
    assert events['time'] == near([-math.log(1.0 - 4.0 * 0.249) / 0.249])
    assert events['normal_speed'] == near([1.0 - 4.0 * 0.249], 1e-9)


def in_gas(rates, seed, n, **rules):
    rules = CollisionRules(box=BOX, **rules)
    beads = mixture(seed, n, rules)
    return replace(beads, drag=np.full(n, rates)), rules


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', ['inelastic', 'species', 'half periodic', 'periodic'])
def test_equal_drag_is_the_gas_without_it_in_another_clock(kernel, name):
    """v(t) = exp(-rate t) w(s) at x(s), s = (1 - exp(-rate t)) / rate."""
    beads, rules = in_gas(RATE, 3, 14, contact_duration=0.0, **RULES.get(name, {}))
    gas = HardSphereGas(beads, rules, kernel)
    free = HardSphereGas(replace(beads, drag=None), rules, kernel)
    times = np.linspace(0.0, 6.0, 13)
    clock = -np.expm1(-RATE * times) / RATE
    dragged = gas.follow(times[-1], times, times, log=True)
    straight = free.follow(clock[-1], clock, clock, log=True)
    assert dragged.events.size == straight.events.size > 5
    assert np.array_equal(dragged.events['partner'], straight.events['partner'])
    left = np.exp(-RATE * times)
    assert dragged.positions == pytest.approx(straight.positions, rel=1e-8, abs=1e-8)
    slowed = left[:, np.newaxis, np.newaxis] * straight.velocities
    assert dragged.velocities == pytest.approx(slowed, rel=1e-8, abs=1e-8)
    speed = left * straight.observations.mean_speed
    assert dragged.observations.mean_speed == pytest.approx(speed, rel=1e-8)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.01, 2.0), st.integers(2, 5))
def test_any_gas_of_equal_drag_is_one_in_another_clock(seed, rate, n):
    beads, rules = in_gas(rate, seed, n, restitution=0.9, contact_duration=0.0)
    end = 0.9 / rate if rate > 0.5 else 2.0
    clock = -math.expm1(-rate * end) / rate
    x, v = HardSphereGas(beads, rules).run_until(end, [end])
    y, w = HardSphereGas(replace(beads, drag=None), rules).run_until(clock, [clock])
    assert x == pytest.approx(y, abs=1e-6)
    assert v == pytest.approx(math.exp(-rate * end) * w, abs=1e-6)


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('tangential', [None, 0.4])
@pytest.mark.parametrize('rates', [(0.1,), (0.3, 0.02, 0.1, 0.2, 0.0, 0.15, 0.05)])
def test_small_steps_in_time_give_the_same_gas(kernel, tangential, rates):
    beads, rules = in_gas(
        rates if len(rates) > 1 else rates[0],
        11,
        7,
        restitution=0.85,
        wall_restitution=0.9,
        tangential_restitution=tangential,
        contact_duration=0.0,
    )
    end = 16.0
    slow = SteppedGas(beads, BOX, restitution=0.85, walls=0.9, tangential=tangential)
    slow.follow(end, 4e-3)
    gas = HardSphereGas(beads, rules, kernel)
    gas.run_until(end)
    assert gas.counts.pair + gas.counts.wall == slow.collisions > 20
    after = gas.beads()
    assert after.positions == pytest.approx(slow.x, abs=1e-7)
    assert after.velocities == pytest.approx(slow.v, abs=1e-7)
    if tangential is not None:
        assert after.spins == pytest.approx(slow.spins, abs=1e-7)


@pytest.mark.parametrize('name', RULES)
def test_scan_and_lists_give_the_same_gas_of_unequal_drag_under_every_rule(name):
    rules = CollisionRules(box=BOX, **RULES[name])
    beads = mixture(21, 12, rules)
    beads = replace(beads, drag=np.linspace(0.0, 0.4, 12))
    times = np.linspace(0.0, 6.0, 61)
    scan, lists = (
        HardSphereGas(beads, rules, kernel).follow(6.0, times, log=True) for kernel in KERNELS
    )
    assert scan.events.size == lists.events.size > 5
    assert scan.positions == pytest.approx(lists.positions, abs=1e-6)
    assert scan.velocities == pytest.approx(lists.velocities, abs=1e-6)
    if rules.motion is None:
        assert smallest_gap(scan.positions, beads.radii, rules) > -1e-9


def test_drag_of_0_is_no_drag_bit_by_bit():
    beads, rules = in_gas(0.0, 5, 6, restitution=0.9)
    with_zeros, without = (
        HardSphereGas(beads, rules),
        HardSphereGas(replace(beads, drag=None), rules),
    )
    for gas in (with_zeros, without):
        gas.run_until(20.0)
    assert with_zeros.drag is None
    assert np.array_equal(with_zeros.beads().positions, without.beads().positions)
    assert np.array_equal(with_zeros.beads().velocities, without.beads().velocities)


def test_speeds_that_decide_about_sticking_are_those_at_the_contact():
    """Two beads 2 apart that close at 1; drag leaves exp(-rate t) = 1 - rate of it."""
    for limit, merged in ((0.69, 0), (0.71, 1)):
        gas = gas_of(
            [(3, 5, 5), (6, 5, 5)],
            [(0.5, 0, 0), (-0.5, 0, 0)],
            drag=np.full(2, RATE),
            sticking_speed=limit,
            aggregate_motion='translating',
        )
        gas.run_until(2.0)
        assert (gas.counts.merge, gas.counts.pair) == (merged, 1 - merged)


def test_the_drag_on_a_body_is_the_sum_over_its_beads():
    """Masses 1 and 3 at rates 0.4 and 0.2: together 0.25; apart again after a restart."""
    gas = gas_of(
        [(3, 5, 5), (5.5, 5, 5)],
        [(1, 0, 0), (0, 0, 0)],
        masses=[1.0, 3.0],
        drag=np.array([0.4, 0.2]),
        sticking_speed=5.0,
        aggregate_motion='translating',
        box=(1000.0, 10.0, 10.0),
    )
    gas.run_until(1.0)
    assert gas.counts.merge == 1
    before = gas.beads().velocities
    gas.run_until(3.0)
    assert gas.beads().velocities == near(math.exp(-0.5) * before)
    assert before[0] == near(before[1])
    assert np.array_equal(gas.beads().drag, [0.4, 0.2])


def test_the_energy_that_the_gas_takes_is_what_the_ledger_does_not_hold():
    beads, rules = in_gas(RATE, 7, 6, **RULES['rough'])
    gas = HardSphereGas(beads, rules)
    times = np.linspace(0.0, 5.0, 20001)
    record = gas.follow(5.0, times, times)
    power = (
        2.0
        * RATE
        * np.sum(
            0.5 * beads.masses * np.sum(record.velocities**2, axis=2)
            + 10.0 / 3.0 * 0.2 * beads.masses * beads.radii**2 * np.sum(record.spins**2, axis=2),
            axis=1,
        )
    )
    taken = energy(beads) - energy(gas.beads()) - gas.ledger[:3].sum()
    assert taken == pytest.approx(np.trapezoid(power, times), rel=1e-3)


@pytest.mark.parametrize('rates', [0.2, (0.1, 0.2, 0.0, 0.3, 0.4, 0.05)])
def test_a_checkpoint_keeps_the_gas_bit_by_bit(tmp_path, rates):
    beads, rules = in_gas(rates, 9, 6, restitution=0.9)
    gas = HardSphereGas(beads, rules)
    gas.run_until(3.0)
    gas.save(tmp_path / 'gas.npz')
    loaded = HardSphereGas.load(tmp_path / 'gas.npz')
    for each in (gas, loaded):
        each.run_until(6.0)
    assert np.array_equal(gas.beads().positions, loaded.beads().positions)
    assert np.array_equal(gas.beads().drag, loaded.beads().drag)


@pytest.mark.parametrize('kernel', [Kernel.SCAN, Kernel.LISTS])
def test_a_bead_rides_with_a_moving_wall_and_meets_it_at_the_right_time(kernel):
    """The wall comes with sin t; the bead flies away from it and is slowed."""
    rate = 0.8
    gas = gas_of(
        [(1.3, 5, 5)],
        [(0.3, 0, 0)],
        drag=np.array([rate]),
        motion=WallMotion(amplitude=(0.9, 0.0, 0.0), angular_frequency=1.0),
        kernel=kernel,
    )
    time = gas.follow(2.0, log=True).events['time'][0]
    bead = 1.3 + 0.3 * -math.expm1(-rate * time) / rate
    assert bead - 1.0 == pytest.approx(0.9 * math.sin(time), abs=1e-9)
    earlier = np.linspace(0.0, time, 1000)[:-1]
    assert np.all(0.3 - 0.3 * np.expm1(-rate * earlier) / rate > 0.9 * np.sin(earlier))


@pytest.mark.parametrize('drag', [[-0.1, 0.0], [math.nan, 1.0], [1.0]])
def test_a_drag_that_cannot_be_is_refused(drag):
    with pytest.raises(SimulationError, match='drag'):
        gas_of([(3, 5, 5), (6, 5, 5)], [(0, 0, 0), (0, 0, 0)], drag=np.array(drag))
