"""What merging and impulses do to a body that turns, against solutions by hand."""

from __future__ import annotations

import numpy as np
import pytest
from gases import KERNELS, gas_of, near
from turning_bodies import MERGING, ROD, rod, spin_of_rod

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


def test_beads_that_stick_off_centre_turn_with_their_angular_momentum(kernel):
    """A bead meets another one 30° off: the arm of its momentum about the centre is 1/2."""
    gas = gas_of(
        [(2, 5, 5), (6, 6, 5)],
        [(2, 0, 0), (0, 0, 0)],
        sticking_speed=3.0,
        box=(40, 40, 10),
        kernel=kernel,
    )
    before = gas.energy, gas.momentum, gas.angular_momentum
    gas.run_until(3.0)
    assert gas.counts.merge == 1
    assert gas.momentum == near(before[1])
    assert gas.angular_momentum == near(before[2])
    spin = np.array([0.0, 0.0, 1.0]) / ROD
    assert gas.spins == near(np.array([spin, spin]))
    assert gas.energy == near(0.5 * 2.0 * 1.0 + 0.5 * ROD * spin[2] ** 2)
    assert gas.ledger[2] == near(before[0] - gas.energy)


def test_beads_that_stick_head_on_do_not_turn(kernel):
    gas = gas_of([(2, 5, 5), (6, 5, 5)], [(1, 0, 0), (0, 0, 0)], sticking_speed=2.0, kernel=kernel)
    gas.run_until(4.0)
    assert gas.counts.merge == 1
    assert gas.spins == near(np.zeros((2, 3)))
    assert gas.beads().velocities == near(np.array([(0.5, 0, 0)] * 2))


def test_masses_and_radii_make_the_tensor_of_inertia(kernel):
    """Beads of mass 1 and 3 and radius 1 and 0.5, along x: the moment across is by hand."""
    start = [(4.0, 10.0, 10.0), (5.5 + 0.01, 10.0 - 0.3, 10.0)]
    gas = gas_of(
        start,
        [(0, 0, 0), (-0.01, 0.3, 0.0)],
        masses=[1.0, 3.0],
        radii=[1.0, 0.5],
        sticking_speed=0.1,
        box=(40.0, 40.0, 20.0),
        kernel=kernel,
    )
    gas.run_until(1.5)
    assert gas.counts.merge == 1
    reduced = 0.75
    inertia = 0.4 * (1.0 + 3.0 * 0.25) + reduced * 1.5**2
    assert gas.spins[:, 2] == near(np.full(2, reduced * 1.5 * 0.3 / inertia))


@pytest.mark.parametrize('restitution', [1.0, 0.6])
def test_an_impulse_at_an_end_moves_and_turns_a_rod(kernel, restitution):
    """A bead of mass 2 hits an end of a rod at rest across: effective mass 1 / (1/2 + 1/2.8)."""
    gas = gas_of(
        [(9, 10, 10), (11.01, 10, 10), (11, 14, 10)],
        [(0, 0, 0), (-0.01, 0, 0), (0, -1, 0)],
        masses=[1, 1, 2],
        sticking_speed=0.1,
        restitution=restitution,
        box=(20, 20, 20),
        kernel=kernel,
    )
    record = gas.follow(2.5, log=True)
    assert [row['kind'] for row in record.events] == ['merge', 'pair']
    # The rod drifts by -0.005 along x, so that the line of centres is no more along y.
    drift = 0.005 * (record.events['time'][1] - 1.0)
    per = 1.0 / 2.0 + 1.0 / 2.0 + 1.0 / ROD
    size = (1.0 + restitution) / per
    assert drift < 0.006
    assert record.events['impulse'][1] == pytest.approx(size, rel=1e-3)
    assert gas.beads().velocities[2, 1] == pytest.approx(-1.0 + size / 2.0, rel=1e-2)
    assert gas.spins[0, 2] == pytest.approx(-size / ROD, rel=1e-2)


def test_a_rod_set_up_by_hand_turns_as_it_should(kernel):
    gas = rod((10.0, 10.0, 10.0), (0.1, 0.2, 0.3), (0.4, 0.1), kernel=kernel)
    gas.run_until(MERGING + 1.0)
    assert gas.spins[0] == near(spin_of_rod((0.4, 0.1)))
    assert gas.momentum == near(2.0 * np.array([0.1, 0.2, 0.3]))
