"""Bodies that turn, counted in the tracks of a gas that shares nothing with the simulator.

``python -m benchmarks turning_bodies`` measures the same over many cycles.
"""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.turning_gas import RATE, Gas, pictures
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import BodyEstimate, Merge
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.bodies.body_counter import BodyCounter

TRAY = load_trays()[1]
NS = 1e9
SECONDS = 12.0


def _counted(frames):
    counter = BodyCounter(PipelineSettings(), TRAY)
    records = [record for frame in frames for record in counter.push(frame.tracks)]
    records += counter.flush()
    return (
        [record for record in records if isinstance(record, BodyEstimate)],
        [record for record in records if isinstance(record, Merge)],
    )


@pytest.fixture(scope='module', params=[1, 2])
def turning(request):
    gas = Gas(0.89, sticking=3e-3)
    return list(pictures(TRAY, gas, request.param, round(SECONDS * RATE)))


def _turn(frames, first, second):
    """Range of the direction from one bead to another while they are in one body, [rad]."""
    together = [frame for frame in frames if frame.bodies[first] == frame.bodies[second]]
    lines = np.array([np.subtract(*frame.tracks.positions[[second, first]]) for frame in together])
    return np.ptp(np.unwrap(np.arctan2(lines[:, 1], lines[:, 0]))) if together else 0.0


def test_the_bodies_of_the_gas_turn(turning):
    turns = [_turn(turning, first, second) for second in range(15) for first in range(second)]
    assert max(turns) > 1.0


def test_merges_of_bodies_that_turn_are_found_and_dated(turning):
    _, merges = _counted(turning)
    numbers = np.array([np.unique(frame.bodies).size for frame in turning])
    times = np.repeat(np.arange(numbers.size) / RATE, -np.diff(numbers, prepend=15))
    dated = np.sort([merge.stamp_ns / NS for merge in merges if merge.joins])
    assert dated[0] == pytest.approx(times[0], abs=0.2)
    # All but those of the last two seconds.
    assert dated.size >= np.count_nonzero(times < SECONDS - 2.0)
    assert dated.size <= times.size
    assert np.abs(dated - times[: dated.size]).mean() < 0.3


def test_bodies_that_turn_are_counted(turning):
    counts, _ = _counted(turning)
    true = np.array(
        [np.unique(turning[round(count.stamp_ns / NS * RATE)].bodies).size for count in counts]
    )
    wrong = np.array([count.bodies.value for count in counts]) - true
    assert np.abs(wrong).mean() < 0.5
    # The last merges are not known yet, which the error says.
    errors = np.array([count.bodies.error for count in counts])
    assert np.mean(np.abs(wrong) <= np.maximum(2.0 * errors, 0.5)) > 0.9


@pytest.mark.parametrize('restitution', [0.5, 0.9])
def test_beads_that_do_not_stick_are_no_bodies(restitution):
    counts, merges = _counted(pictures(TRAY, Gas(restitution), 3, round(20.0 * RATE)))
    assert not merges
    assert {count.bodies.value for count in counts} == {15.0}
