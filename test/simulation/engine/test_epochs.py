"""Epochs keep the precision of times, and change nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from gases import (
    ALL_RULES,
    ALWAYS,
    BOX,
    KERNELS,
    angular_momentum,
    energy,
    gas_of,
    mixture,
    near,
    smallest_gap,
)

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.gas_state import EPOCH, QUANTUM
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

pytestmark = pytest.mark.parametrize('kernel', KERNELS)

OFTEN = 2.0**-4


def pair_of_gases(beads, rules, kernel, quantum=OFTEN):
    """The same gas twice; time of the second is counted anew very often."""
    often = HardSphereGas(beads, rules, kernel)
    often._state.clock[QUANTUM] = quantum
    return HardSphereGas(beads, rules, kernel), often


@pytest.mark.parametrize('quantum', [2.0**-10, OFTEN, 0.125])
@pytest.mark.parametrize('name', ALL_RULES)
def test_trajectories_agree_until_chaos(kernel, name, quantum):
    """With events much rarer than time is counted anew, as rare, and more frequent."""
    rules = CollisionRules(box=BOX, **ALL_RULES[name])
    gas, often = pair_of_gases(mixture(9, 10, rules), rules, kernel, quantum)
    events = gas.follow(40.0, log=True).events[:25]
    end = 0.5 * (events['time'][-1] + events['time'][-2])
    times = np.linspace(0.0, end, 7)
    gas, _ = pair_of_gases(mixture(9, 10, rules), rules, kernel)
    record, second = (run.follow(end, times, times, log=True) for run in (gas, often))
    assert often._state.clock[EPOCH] >= 5 * quantum
    assert gas._state.clock[EPOCH] == 0.0
    for field in ('kind', 'bead', 'partner'):
        np.testing.assert_array_equal(second.events[field], record.events[field])
    for field in ('time', 'normal_speed', 'impulse'):
        np.testing.assert_allclose(second.events[field], record.events[field], atol=1e-6)
    np.testing.assert_allclose(second.positions, record.positions, atol=1e-6)
    np.testing.assert_allclose(second.velocities, record.velocities, atol=1e-6)
    for field in ('mean_speed', 'energy_lost', 'wall_impulse', 'granular_temperature'):
        first_values, second_values = (
            getattr(record.observations, field),
            getattr(second.observations, field),
        )
        np.testing.assert_allclose(second_values, first_values, atol=1e-6)
    assert often.now == end


def test_contacts_are_kept_across_epochs(kernel):
    """The second contact of the pair comes 8 s after the first, within 8.1 s but not 7.9 s."""
    for duration, speed in ((7.9, 0.25), (8.1, 0.5)):
        gas = gas_of(
            [(2, 5, 5), (5, 5, 5)],
            [(0, 0, 0), (-1, 0, 0)],
            masses=[1e18, 1],
            box=(7, 10, 10),
            restitution=0.5,
            contact_duration=duration,
            kernel=kernel,
        )
        gas._state.clock[QUANTUM] = 0.25
        record = gas.follow(10.0, [10.0], log=True)
        assert record.events['time'] == near([1.0, 5.0, 9.0])
        assert record.velocities[0, 1, 0] == near(speed)


def test_walls_move_on_across_epochs(kernel):
    motion = WallMotion(amplitude=(0.3, 0, 0), angular_frequency=2 * np.pi, start=20.25)
    gas = gas_of([(5, 5, 5)], [(0, 0.25, 0)], motion=motion, kernel=kernel)
    gas._state.clock[QUANTUM] = 0.5
    # A bead at rest along x, 0.15 from the wall that comes 1/12 s after the start.
    second = gas_of([(1.15, 5, 5)], [(0, 0.25, 0)], motion=motion, kernel=kernel)
    second._state.clock[QUANTUM] = 0.5
    events = second.follow(21.0, log=True).events
    assert events['time'][events['partner'] == 0] == near([20.25 + 1 / 12])
    assert gas.follow(21.0, log=True).events['partner'].tolist() == [3]


def test_frame_times_do_not_depend_on_epochs(kernel):
    gas = gas_of([(5, 5, 5)], [(0.5, 0, 0)], box=(9, 10, 10), kernel=kernel)
    gas._state.clock[QUANTUM] = 0.25
    times = np.arange(0.0, 1000.0, 0.37)
    record = gas.follow(1000.0, times)
    # Between walls 7 apart, from 4 beyond the first: unfolded, then folded.
    path = (4.0 + 0.5 * times) % 14.0
    expected = 1.0 + np.minimum(path, 14.0 - path)
    np.testing.assert_allclose(record.positions[:, 0, 0], expected, atol=1e-10)


def test_times_may_be_saved_and_loaded_in_any_epoch(kernel, tmp_path):
    rules = CollisionRules(box=BOX, restitution=0.95, contact_duration=0.1)
    _, gas = pair_of_gases(mixture(9, 10, rules), rules, kernel)
    gas.run_until(7.7)
    assert gas._state.clock[EPOCH] > 5.0
    gas.save(tmp_path / 'gas')
    expected = gas.follow(20.0, [8.0, 20.0], log=True)
    loaded = HardSphereGas.load(tmp_path / 'gas')
    assert loaded.now == 7.7
    record = loaded.follow(20.0, [8.0, 20.0], log=True)
    np.testing.assert_array_equal(record.events, expected.events)
    np.testing.assert_array_equal(record.positions, expected.positions)


@pytest.mark.parametrize('periodic', [False, True])
def test_a_run_of_very_many_epochs_keeps_energy_and_gaps(kernel, periodic):
    rules = CollisionRules(
        box=BOX,
        periodic=(periodic,) * 3,
        tangential_restitution=1.0,
        wall_tangential_restitution=1.0,
    )
    gas, often = pair_of_gases(mixture(9, 10, rules), rules, kernel, 2.0**-6)
    energy_before, angular_momentum_before = energy(often.beads()), angular_momentum(often.beads())
    for run in (gas, often):
        record = run.follow(300.0, np.linspace(0.0, 300.0, 301))
        assert run.counts.pair > 500
        assert abs(energy(run.beads()) / energy_before - 1.0) < 1e-12
        assert smallest_gap(record.positions, run.radii, rules) > -1e-10
    if not periodic:
        total = angular_momentum(often.beads()) + often.ledger[12:15]
        assert total == pytest.approx(angular_momentum_before, abs=1e-9)
    # Observables of the two, which are different gases by now, are of one equilibrium.
    rates = [run.counts.pair for run in (gas, often)]
    assert rates[1] == pytest.approx(rates[0], rel=0.2)


def test_a_long_run_starts_new_epochs(kernel):
    gas = gas_of([(5, 5, 5)], [(1, 0.7, 0.4)], kernel=kernel)
    quantum = gas._state.clock[QUANTUM]
    crossing = 10 / np.sqrt(1.65)
    assert 50 * crossing < quantum < 150 * crossing
    gas.run_until(20.5 * quantum)
    assert gas._state.clock[EPOCH] == 20 * quantum
    assert gas.now == 20.5 * quantum
    assert energy(gas.beads()) == near(0.5 * (1 + 0.49 + 0.16))


def test_time_does_not_go_back_into_an_earlier_epoch(kernel):
    rules = CollisionRules(box=BOX, periodic=ALWAYS)
    _, gas = pair_of_gases(mixture(9, 10, rules), rules, kernel)
    gas.run_until(5.0)
    with pytest.raises(SimulationError, match=r'already at 5\.0 s'):
        gas.run_until(4.999)
