"""Energy, momentum and overlap in gases of the reference engine."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from reference.cases import ALWAYS, Motion, Rules, Uniform, Viscoelastic, energy, gas_of, momentum


def shaken_gas(rules, seed=1):
    random = np.random.default_rng(seed)
    grid = np.array(list(itertools.product((1.5, 5.0), (1.5, 5.0), (1.5, 5.0, 8.2))))
    radii = random.uniform(0.6, 1.1, 12)
    return gas_of(
        grid,
        random.normal(size=(12, 3)),
        radii=radii,
        masses=radii**3,
        rules=replace(rules, box=(7.0, 7.0, 10.0)),
        spins=random.normal(size=(12, 3)) if rules.tangential_restitution is not None else None,
        species=random.integers(0, 2, 12),
    )


def smallest_gap(gas):
    gaps = [math.inf]
    for i, j in itertools.combinations(range(len(gas.body)), 2):
        apart = gas.positions[j] - gas.positions[i]
        box, periodic = np.array(gas.rules.box), np.array(gas.rules.periodic)
        apart -= np.where(periodic, box * np.round(apart / box), 0.0)
        gaps.append(np.linalg.norm(apart) - gas.beads.radii[i] - gas.beads.radii[j])
    for side, axis in itertools.product((0, 1), range(3)):
        if not gas.rules.periodic[axis]:
            wall = gas.tray.coordinate(2 * axis + side, gas.time)
            gaps.extend((gas.positions[:, axis] - wall) * (1 - 2 * side) - gas.beads.radii)
    return min(gaps)


ROUGH = {'tangential_restitution': 0.4, 'wall_tangential_restitution': -0.2}
SHAKE = Motion(
    (0.2, 0.1, 0.3),
    angular_frequency=9.0,
    damping=0.05,
    start=0.3,
    end=0.3 + 10 * math.pi / 9.0,  # back where it started: a tray that jumps hits nothing
)
GASES = {
    'elastic': {},
    'species': {'restitution': ((0.9, 0.8), (0.8, 0.7)), 'wall_restitution': 0.9},
    'periodic': {'periodic': ALWAYS, 'restitution': Uniform(0.8, 0.2)},
    'half periodic': {'periodic': (True, False, True), 'sticking_speed': 0.5},
    'rough': ROUGH | {'restitution': Viscoelastic(0.8, 1.0), 'contact_duration': 0.05},
    'sticky': ROUGH
    | {'sticking_speed': 0.4, 'wall_sticking_speed': 0.3, 'sticking_measure': 'total'},
    'fixing': {'sticking_speed': 0.3, 'wall_sticking_speed': 0.3},
    'shaken': ROUGH
    | {'motion': SHAKE, 'restitution': 0.7, 'wall_restitution': 0.5, 'contact_duration': 1e-4},
    'shaken slit': {
        'motion': SHAKE,
        'periodic': (True, True, False),
        'sticking_speed': 0.8,
        'contact_duration': 1e-4,
    },
}


@pytest.mark.parametrize('name', GASES)
def test_the_ledger_balances_and_nothing_overlaps(name):
    gas = shaken_gas(Rules(**GASES[name]))
    energy_before, momentum_before = energy(gas), momentum(gas)
    kinds, time = set(), 0.0
    for _ in range(200):
        event = gas.step()
        if event is None:
            break
        assert event.time >= time
        time = event.time
        kinds.add(event.kind)
        assert smallest_gap(gas) > -1e-11
    ledger = gas.ledger
    lost = ledger.energy_lost_in_pairs + ledger.energy_lost_at_walls + ledger.energy_lost_in_merges
    assert energy(gas) + lost == pytest.approx(energy_before, rel=1e-12)
    given = ledger.wall_impulse.sum(axis=0) + ledger.fixed_impulse
    assert momentum(gas) + given == pytest.approx(momentum_before, rel=1e-12, abs=1e-11)
    if 'motion' in GASES[name]:
        assert ledger.energy_lost_at_walls < 0.0
    else:
        assert min(lost, ledger.energy_lost_at_walls) > -1e-11
    assert ('merge' in kinds) == ('sticking_speed' in GASES[name])
    assert ('fix' in kinds) == ('wall_sticking_speed' in GASES[name])


def test_executing_in_pieces_changes_nothing():
    straight, pieces = (shaken_gas(Rules(periodic=ALWAYS, restitution=0.9)) for _ in range(2))
    events = straight.run_until(2.0)
    parts = [event for end in (0.3, 0.9, 1.3, 2.0) for event in pieces.run_until(end)]
    assert [(e.kind, e.i, e.partner) for e in events] == [(e.kind, e.i, e.partner) for e in parts]
    assert straight.positions == pytest.approx(pieces.positions, abs=1e-9)


@pytest.mark.parametrize(
    'wrong',
    [
        {'motion': SHAKE, 'wall_sticking_speed': 0.1},
        {'sticking_measure': 'spin'},
        {'wall_tangential_restitution': 0.5},
    ],
)
def test_rules_that_exclude_each_other_are_refused(wrong):
    with pytest.raises(ValueError, match='; '):
        gas_of([(5, 5, 5)], [(0, 0, 0)], rules=Rules(**wrong))
