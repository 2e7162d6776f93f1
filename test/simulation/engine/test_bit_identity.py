"""The same beads and rules give the same trajectories, bit by bit, on every machine."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest
from gases import ALL_RULES, ALWAYS, BOX, KERNELS, Beads, placed

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

# CRC-32 of places and velocities after 30 s. The rules are those that need no more than
# + - * /, square roots and integers; sines and powers differ from machine to machine.
GOLDEN = {
    'inelastic': {'scan': (395183756, 4026217824), 'lists': (4232614788, 1052747800)},
    'half periodic': {'scan': (1262311415, 1848979193), 'lists': (1808342153, 2565538268)},
    'species': {'scan': (2505272471, 3254736298), 'lists': (1270870054, 4144898922)},
    'random': {'scan': (3344575901, 513728827), 'lists': (1335779389, 2812309651)},
    'sticking': {'scan': (970506315, 422705974), 'lists': (3439820232, 3729057012)},
    'rough and sticking': {'scan': (84539865, 1852282705), 'lists': (979821484, 3226169597)},
    'contact duration': {'scan': (541658232, 1961044516), 'lists': (1752359490, 2134086689)},
}


def beads_for(rules, n=20):
    """With nothing but uniform numbers and products: these too are the same everywhere."""
    random = np.random.default_rng(1)
    radii = random.uniform(0.6, 1.0, n)
    return Beads(
        radii=radii,
        masses=radii * radii * radii,
        positions=placed(random, radii, rules.box, rules.periodic),
        velocities=random.uniform(-1.0, 1.0, (n, 3)),
        spins=random.uniform(-1.0, 1.0, (n, 3)) if rules.tangential_restitution else None,
        species=np.arange(n) % 2 if np.ndim(rules.restitution) == 2 else None,
    )


def fingerprint(name, kernel):
    box = tuple(1.5 * side for side in BOX)
    rules = CollisionRules(box=box, **ALL_RULES[name])
    record = HardSphereGas(beads_for(rules), rules, kernel).follow(30.0, [30.0])
    return tuple(
        zlib.crc32(np.ascontiguousarray(array).tobytes())
        for array in (record.positions, record.velocities)
    )


@pytest.mark.parametrize('name', GOLDEN)
def test_trajectories_match_stored_checksums(name):
    scan, lists = (fingerprint(name, kernel) for kernel in KERNELS)
    assert {'scan': scan, 'lists': lists} == GOLDEN[name]


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', ALL_RULES)
def test_two_runs_are_bit_identical(name, kernel):
    assert fingerprint(name, kernel) == fingerprint(name, kernel)


@pytest.mark.parametrize('kernel', KERNELS)
def test_one_changed_bit_of_a_position_changes_the_trajectories(kernel):
    """What is compared above is as sharp as can be."""
    rules = CollisionRules(box=BOX, periodic=ALWAYS)
    beads = beads_for(rules, 6)
    moved = beads.positions.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], np.inf)
    first, second = (
        HardSphereGas(replace(beads, positions=positions), rules, kernel).follow(30.0, [30.0])
        for positions in (beads.positions, moved)
    )
    assert not np.array_equal(first.positions, second.positions)
