"""Walls of drawn gases with friction and drag, from true tracks."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.coverage import coverage
from benchmarks.drawn_friction import SHARES, SHOWN, drawn_cycle

TRAY, CYCLES = 1, 12


@pytest.fixture(scope='module', params=[(0.0, 0.0), (0.0, 0.01), (0.02, 0.03)], ids=str)
def case(request):
    return request.param, [drawn_cycle(TRAY, run, *request.param) for run in range(CYCLES)]


def test_intervals_hold_with_friction_and_drag(case):
    _, cycles = case
    for name in ('walls', 'beads'):
        seen = coverage([getattr(cycle, name) for cycle in cycles], 0.0)
        assert seen.known >= 0.9 * CYCLES
        assert seen.holds >= 0.85


def test_no_loss_beside_a_rebound_counts_twice(case):
    _, cycles = case
    errors = [
        2.0 * cycle.walls.value / (cycle.walls.upper - cycle.walls.lower) for cycle in cycles
    ]
    # In half-widths; before drag went with friction 0.4 with a friction of 0.01.
    assert abs(np.nanmean(errors)) < 0.3


def test_hits_take_off_a_part_of_what_sliding_beads_would_lose(case):
    (_, friction), cycles = case
    pulls = dict(zip(SHARES, np.nanmean([cycle.pulls for cycle in cycles], axis=0), strict=True))
    if friction:
        assert pulls[0.0] < -0.4
        assert pulls[1.0] > 0.3
    assert abs(pulls[0.5]) < 0.5


def test_rebounds_show_the_share_of_friction_that_all_cycles_show(case):
    (_, friction), cycles = case
    together = np.sum([cycle.shown for cycle in cycles], axis=0)
    if not friction:
        assert np.isnan(together).all()
        return
    # 80 cycles of each friction and drag up to a friction of 0.03 showed 0.89 to 1.02.
    possible = SHOWN[together > together.max() - 2.0]
    assert possible[0] < 1.02
    assert possible[-1] > 0.89
