"""The truth about beads: one layout, read from the message definition."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from nanorocks_ros.errors import FrameError
from nanorocks_ros.records import BeadsTruth
from nanorocks_ros.wire.bead_truth import beads_from_array, beads_layout, beads_to_array

DEFINITION = Path(__file__).parents[2] / 'msg_defs/nanorocks_msgs/msg/BeadsTruth.msg'
EPOCH = 1_700_000_000_000_000_000
RNG = np.random.default_rng(5)
TRUTH = BeadsTruth(
    stamp_ns=EPOCH + 2_500_000_000,
    tray=3,
    cycle=2,
    displacement=np.array([1e-4, -2e-4]),
    tray_velocity=np.array([1e-3, 2e-3]),
    positions=RNG.random((5, 3)) * 0.03,
    velocities=RNG.random((5, 3)) * 0.01,
    radii=np.full(5, 0.001),
    species=np.array([0, 0, 1, 1, 1], dtype=np.int32),
    bodies=np.array([0, 1, 1, 3, 4], dtype=np.int32),
)


def test_the_truth_comes_back_from_its_array_to_float32_rounding():
    values = beads_to_array(TRUTH, EPOCH)
    assert values.dtype == np.float32
    back = beads_from_array(values, tray=3, epoch_ns=EPOCH, where='test')
    assert (back.stamp_ns, back.tray, back.cycle) == (TRUTH.stamp_ns, 3, 2)
    for name in ('displacement', 'tray_velocity', 'positions', 'velocities', 'radii'):
        np.testing.assert_allclose(getattr(back, name), getattr(TRUTH, name), rtol=2**-23)
    np.testing.assert_array_equal(back.species, TRUTH.species)
    np.testing.assert_array_equal(back.bodies, TRUTH.bodies)
    np.testing.assert_array_equal(back.ids, [0, 1, 2, 3, 4])


def test_the_layout_is_the_message_definition_as_an_independent_parser_reads_it():
    parsed = get_types_from_msg(DEFINITION.read_text(), 'nanorocks_msgs/msg/BeadsTruth')
    _, fields = parsed['nanorocks_msgs/msg/BeadsTruth']
    array = beads_layout()
    single = [name for name, kind in fields if kind[0] == Nodetype.BASE]
    lists = [name for name, kind in fields if kind[0] == Nodetype.SEQUENCE]
    assert [name for name, _ in fields] == ['header', *single, *lists]
    assert [field.name for field in array.head] == single
    assert [field.name for field in array.bead] == lists
    assert all(field.unit and field.doc for field in (*array.head, *array.bead))


def test_the_dimensions_say_what_is_where():
    head, beads, row = beads_layout().dimensions(5)
    assert head[0].split(',')[:2] == ['time', 'cycle']
    assert head[1] + beads[2] == beads_to_array(TRUTH, EPOCH).size
    assert beads[1:] == (5, 5 * row[1])
    at = head[1] + 2 * row[1] + row[0].split(',').index('radius')
    assert beads_to_array(TRUTH, EPOCH)[at] == np.float32(0.001)


def test_arrays_that_hold_no_whole_beads_are_refused():
    values = beads_to_array(TRUTH, EPOCH)
    with pytest.raises(FrameError, match='/beads: 51 elements are not 7 and 9 for each bead'):
        beads_from_array(values[:-1], tray=3, epoch_ns=0, where='/beads')
    with pytest.raises(FrameError, match='3 elements'):
        beads_from_array(values[:3], tray=3, epoch_ns=0, where='/beads')
    values[8] = np.nan
    with pytest.raises(FrameError, match='element 8 is nan'):
        beads_from_array(values, tray=3, epoch_ns=0, where='/beads')


def test_a_tray_without_beads_is_an_array_too():
    values = beads_to_array(TRUTH, EPOCH)[:7]
    assert beads_from_array(values, tray=3, epoch_ns=EPOCH, where='test').radii.size == 0
