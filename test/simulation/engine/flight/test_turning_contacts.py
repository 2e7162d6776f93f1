"""No contact of a body that turns is missed, and each is where the exact paths touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gases import KERNELS, mixture, smallest_gap
from stepped_bodies import SteppedBodies

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

STICKING, END = 1.5, 12.0


def gas_and_beads(seed, kernel, n=12, drag=None):
    rules = CollisionRules(
        box=(12, 11, 10), restitution=0.8, wall_restitution=0.9, sticking_speed=STICKING
    )
    beads = mixture(seed, n, rules)
    if drag is not None:
        beads = replace(beads, drag=np.linspace(*drag, n))
    return HardSphereGas(beads, rules, kernel), beads, rules


@pytest.mark.parametrize('drag', [None, (0.05, 0.05)])
@pytest.mark.parametrize('seed', [4, 6, 7])
def test_events_and_velocities_are_those_of_an_independent_integration(seed, drag):
    """Bodies merge, turn, collide and rebound; Runge-Kutta steps find the same events.

    With drag they add the forces and torques on all beads of a body.
    """
    gas, beads, rules = gas_and_beads(seed, KERNELS[0], drag=drag)
    events = gas.follow(END, log=True).events
    stepped = SteppedBodies(
        beads, rules.box, restitution=0.8, walls=0.9, sticking=rules.sticking_speed
    )
    stepped.follow(END, 1e-2)
    assert gas.counts.merge >= 3
    assert [tuple(row)[1:4] for row in events] == [row[1:] for row in stepped.events]
    np.testing.assert_allclose(events['time'], [row[0] for row in stepped.events], atol=1e-7)
    places, velocities = stepped.places_and_velocities()
    np.testing.assert_allclose(gas.beads().positions, places, atol=1e-7)
    np.testing.assert_allclose(gas.beads().velocities, velocities, atol=1e-7)
    np.testing.assert_array_equal(gas.bodies, stepped.labels())


@pytest.mark.parametrize('kernel', KERNELS)
def test_nothing_overlaps_in_a_long_run_of_large_bodies(kernel):
    _, beads, rules = gas_and_beads(4, kernel, n=20)
    gas = HardSphereGas(beads, replace(rules, wall_restitution=1.0), kernel)
    times = np.linspace(0.0, 600.0, 12_001)
    record = gas.follow(600.0, times)
    assert np.bincount(gas.bodies).max() > 8
    assert gas.counts.wall > 150
    assert smallest_gap(record.positions, beads.radii, rules) > -1e-10


@pytest.mark.parametrize('drag', [None, (0.005, 0.06)])
def test_lists_and_scan_find_the_same_events(drag):
    """Also where the gas slows each bead at a rate of its own; nothing overlaps there."""
    records = []
    for kernel in KERNELS:
        gas, beads, rules = gas_and_beads(5, kernel, n=20, drag=drag)
        record = gas.follow(8.0, np.linspace(0.0, 8.0, 401), log=True)
        assert smallest_gap(record.positions, beads.radii, rules) > -1e-10
        records.append(record.events)
    scan, lists = records
    assert (scan['kind'] == 'merge').sum() > 5
    for field in ('kind', 'bead', 'partner'):
        np.testing.assert_array_equal(scan[field], lists[field])
    np.testing.assert_allclose(scan['time'], lists['time'], atol=1e-6)
