"""The state of a large gas is copied into huge pages without a change of its values."""

import numpy as np
import pytest

from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.neighbours.huge_pages import in_large_pages
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

LINE = 64


def gas_of(n):
    """Beads on a grid, all lists built."""
    side = int(np.ceil(n ** (1 / 3)))
    places = np.array(list(np.ndindex(side, side, side)))[:n] + 0.5
    beads = Beads(
        radii=np.full(n, 0.3),
        masses=np.ones(n),
        positions=places,
        velocities=np.random.default_rng(n).normal(size=(n, 3)),
    )
    return HardSphereGas(beads, CollisionRules(box=(side,) * 3))


@pytest.fixture(scope='module')
def large():
    return gas_of(12_000)


def test_a_large_gas_lies_side_by_side_and_every_table_starts_a_line(large):
    tables = [array for array in large._state if array.size]
    starts = [array.ctypes.data for array in tables]
    ends = [array.ctypes.data + array.nbytes for array in tables]
    assert all(start % LINE == 0 for start in starts)
    assert all(0 <= start - end < LINE for end, start in zip(ends, starts[1:], strict=False))


def test_the_copy_changes_no_value(large):
    moved = in_large_pages(large._state)
    for name, before in large._state._asdict().items():
        after = getattr(moved, name)
        assert after.ctypes.data != before.ctypes.data
        assert (after.dtype, after.shape) == (before.dtype, before.shape)
        np.testing.assert_array_equal(after, before)


def test_a_small_gas_is_not_copied():
    state = gas_of(60)._state
    assert in_large_pages(state) is state


def test_trajectories_do_not_depend_on_the_memory_block(large, tmp_path):
    elsewhere = gas_of(12_000)
    elsewhere._state = type(elsewhere._state)(*(array.copy() for array in elsewhere._state))
    file = tmp_path / 'gas.npz'
    large.save(file)
    for gas in (large, elsewhere, loaded := HardSphereGas.load(file)):
        gas.run_until(0.3)
    assert large.counts.pair > 1000
    for gas in (elsewhere, loaded):
        np.testing.assert_array_equal(gas.beads().positions, large.beads().positions)
