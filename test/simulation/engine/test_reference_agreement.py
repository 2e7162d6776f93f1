"""Both kernels and the reference engine agree event by event, until chaos separates them.

How long that is, a twin of the reference tells: its beads start 1e-13 of the box from their
places, more than what rounding does to the engine. While the twin and the reference agree to
1e-6, so must the engine and the reference.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pytest
from gases import BOX, KERNELS, RULES, mixture, to_nearest
from reference.gas import ReferenceGas

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

BEADS = 7
END = 60.0
CHAOS = 1e-6
# The slip of a twin is random: now and then it grows less than that of the engine.
AGREEMENT = 1e-5
OUTWARD = np.array([-1.0, 1.0] * 3)

LEAST_EVENTS = 280
EXPECTED_KINDS = {
    'sticking': {'pair', 'wall', 'merge'},
    'sticking, total speed': {'pair', 'wall', 'merge'},
    'sticking, periodic': {'pair', 'merge'},
    'sticking to walls': {'pair', 'wall', 'merge', 'fix'},
    'rough and sticking': {'pair', 'wall', 'merge', 'fix'},
    'periodic': {'pair'},
}


@dataclass
class Agreed:
    """Events of the reference before chaos, and the gas between the last of them and the next."""

    events: list
    time: float
    ended: bool
    state: dict


def reference_of(beads, rules, moved=0.0):
    return ReferenceGas(
        beads.radii,
        beads.masses,
        beads.positions + moved,
        beads.velocities,
        rules,
        spins=beads.spins,
        species=beads.species,
    )


def are_alike(first, twin_event, tolerance):
    """Whether two events are the same, in natural units."""
    if first is None or twin_event is None:
        return first is twin_event
    same = (first.kind, first.i, first.partner) == (
        twin_event.kind,
        twin_event.i,
        twin_event.partner,
    )
    differences = (
        first.time - twin_event.time,
        first.speed - twin_event.speed,
        first.impulse - twin_event.impulse,
    )
    return same and max(map(abs, differences)) <= tolerance


def state_of(gas):
    ledger = gas.ledger
    return {
        'time': gas.time,
        'positions': gas.positions,
        'velocities': gas.velocities,
        'spins': gas.spins,
        'bodies': gas.body,
        'stuck': gas.fixed,
        'lost': [
            ledger.energy_lost_in_pairs,
            ledger.energy_lost_at_walls,
            ledger.energy_lost_in_merges,
        ],
        'given': ledger.wall_momentum,
    }


def until_chaos(beads, rules, seed):
    random = np.random.default_rng(1000 + seed)
    slip = 1e-13 * random.uniform(-1.0, 1.0, beads.positions.shape) * np.array(rules.box)
    reference, twin = reference_of(beads, rules), reference_of(beads, rules, slip)
    events = []
    while True:
        state = state_of(reference)
        event, twin_event = reference.step(END), twin.step(END)
        if event is None and twin_event is None:
            return Agreed(events, END, True, state)
        if not are_alike(event, twin_event, CHAOS):
            following = min(
                candidate.time for candidate in (event, twin_event) if candidate is not None
            )
            return Agreed(events, 0.5 * (events[-1].time + following), False, state)
        events.append(event)


def compare_events(agreed, record):
    gas_events = record.events
    for event, row in zip(agreed.events, gas_events, strict=False):
        key = row['kind'], row['bead'], row['partner']
        assert key == (event.kind, event.i, event.partner), (event, row)
        assert abs(row['time'] - event.time) < AGREEMENT, (event, row)
        assert abs(row['normal_speed'] - event.speed) < AGREEMENT, (event, row)
        assert abs(row['impulse'] - event.impulse) < AGREEMENT, (event, row)
    # At the very end of what is agreed, the last event may not have come, or the next one may.
    assert abs(len(gas_events) - len(agreed.events)) <= (0 if agreed.ended else 1)


def compare_states(agreed, gas, record, rules):
    state = agreed.state
    flown = state['velocities'] * (agreed.time - state['time'])
    apart = to_nearest(record.positions[0] - state['positions'] - flown, rules.box, False)
    np.testing.assert_allclose(apart, 0.0, atol=AGREEMENT)
    np.testing.assert_allclose(record.velocities[0], state['velocities'], atol=AGREEMENT)
    if record.spins is not None:
        np.testing.assert_allclose(record.spins[0], state['spins'], atol=AGREEMENT)
    np.testing.assert_array_equal(gas.bodies, state['bodies'])
    np.testing.assert_array_equal(gas.stuck, state['stuck'])
    np.testing.assert_allclose(gas.ledger[:3], state['lost'], atol=AGREEMENT)
    np.testing.assert_allclose(gas.ledger[3:9], OUTWARD * state['given'], atol=AGREEMENT)


def agreement(beads, rules, seed):
    """Check both kernels; the events of the reference, and the gases."""
    agreed = until_chaos(beads, rules, seed)
    gases = [HardSphereGas(beads, rules, kernel) for kernel in KERNELS]
    for gas in gases:
        record = gas.follow(agreed.time, [agreed.time], log=True)
        compare_events(agreed, record)
        if len(record.events) == len(agreed.events):
            compare_states(agreed, gas, record, rules)
    return agreed.events, gases


@pytest.mark.parametrize('name', RULES)
def test_both_kernels_and_the_reference_agree_until_chaos(name):
    rules = CollisionRules(box=BOX, **RULES[name])
    # Without walls chaos comes after fewer events.
    seeds = range(16 if all(rules.periodic) else 8)
    seen = Counter()
    for seed in seeds:
        events, _ = agreement(mixture(seed, BEADS, rules), rules, seed)
        seen.update(event.kind for event in events)
    assert set(seen) == EXPECTED_KINDS.get(name, {'pair', 'wall'})
    assert sum(seen.values()) >= LEAST_EVENTS
    assert 2 * seen['pair'] >= 3.5 * BEADS * len(seeds)


@pytest.mark.parametrize('name', ['half periodic', 'sticking'])
def test_lists_of_a_part_of_the_beads_agree_with_the_reference(name):
    rules = CollisionRules(box=(13.0, 12.0, 11.0), **RULES[name])
    events, (_, listed) = agreement(mixture(1, 24, rules), rules, 1)
    assert len(events) >= 80
    assert listed.counts.renewed > 24
    assert listed._state.neighbours[:, 0].mean() < 12
