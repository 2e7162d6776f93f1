"""Bonds among pairs of beads that meet and separate."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.bonds import BondFinder
from nanorocks_ros.stages.bodies.touching_pairs import SeenBeads

RADIUS = 1e-3


def _beads(positions, speed=1e-3):
    n = len(positions)
    return SeenBeads(
        ids=np.arange(n, dtype=np.int64),
        positions=np.array(positions, dtype=float),
        errors=np.full(n, 1e-6),
        radii=np.full(n, RADIUS),
        radius_errors=np.zeros(n),
        variances=np.full(n, speed**2),
        height=4e-3,
    )


@pytest.mark.parametrize('odd', [0, 1])
def test_a_broken_bond_is_reported_while_other_pairs_meet(odd):
    # So many encounters per metre that every pair that stays together is a bond.
    finder = BondFinder(1e6, lambda radii, _: np.full_like(radii, 1e6), 1.0)
    bonds, broken = [], []
    for number in range(60):
        # The first two meet in every other frame.
        apart = 2.0 * RADIUS if number % 2 == odd else 5e-3
        away = 0.0 if number < 30 else 4e-3
        positions = [(0.0, 0.0), (apart, 0.0), (0.02, 0.0), (0.02 + 2.0 * RADIUS + away, 0.0)]
        bonds_now, broken_now = finder.push(number / 30.0, _beads(positions), 0.5)
        bonds += [bond.ids for bond in bonds_now]
        broken += broken_now
    assert (2, 3) in bonds
    assert broken == [(2, 3)]


@pytest.mark.parametrize(('hidden', 'bonds'), [(True, []), (False, [(0, 1)])])
def test_time_in_which_a_bead_is_hidden_is_no_time_beside_each_other(hidden, bonds):
    # Encounters and collisions as in tray 5; free beads part within some hundredths of a second.
    finder = BondFinder(1e3, lambda radii, _: np.full_like(radii, 1e3), 1.0)
    positions, bonded = [(0.0, 0.0), (2.0 * RADIUS, 0.0)], []
    for number in range(30):
        seen = 1 if hidden and 2 <= number < 28 else 2
        new, _ = finder.push(number / 30.0, _beads(positions[:seen], speed=1e-2), 1e-9)
        bonded += [bond.ids for bond in new]
    assert bonded == bonds


@pytest.mark.parametrize(('cools', 'bonds'), [(True, []), (False, [(0, 1)])])
def test_a_gas_that_came_to_rest_parts_no_pair(cools, bonds):
    # The first velocities of beads at rest are those of noise: 10 mm/s, then 0.1.
    finder = BondFinder(1e3, lambda radii, _: np.full_like(radii, 1e3), 1.0)
    positions, bonded = [(0.0, 0.0), (2.0 * RADIUS, 0.0)], []
    for number in range(30):
        speed = 1e-4 if cools and number > 1 else 1e-2
        new, _ = finder.push(number / 30.0, _beads(positions, speed=speed), 1e-9)
        bonded += [bond.ids for bond in new]
    assert bonded == bonds
