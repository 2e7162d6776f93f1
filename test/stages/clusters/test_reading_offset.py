"""The offset of a camera's autocorrelations, learned while all beads are single."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.cluster_size.cluster_curve import curve_of
from nanorocks_ros.records import NS, Measured
from nanorocks_ros.stages.clusters.reading_offset import ReadingOffset

CURVE = curve_of(load_trays()[1])
SINGLE = float(CURVE.reading[0])


def learned(offsets, *, cycle=1, step=0.2, before=True):
    """After images of single beads every `step` seconds of a cycle that begins at 10 s."""
    offset = ReadingOffset(CURVE)
    if before:
        offset.follow(cycle - 1, 9 * NS)
    for index, value in enumerate(offsets):
        stamp_ns = 10 * NS + round(index * step * NS)
        offset.follow(cycle, stamp_ns)
        offset.learn(SINGLE + value, stamp_ns)
    return offset


def test_without_images_of_single_beads_no_offset_is_known():
    assert learned([]).known() is None


def test_the_offset_is_the_mean_reading_of_single_beads_with_at_least_its_scatter():
    offsets = np.random.default_rng(1).normal(0.12, 0.03, 15)
    known = learned(offsets).known()
    assert known.value == pytest.approx(offsets.mean())
    assert offsets.std() <= known.error < 0.1


def test_an_offset_far_from_the_calibration_is_less_certain_for_clusters():
    near, far = learned([0.0] * 10).known(), learned([0.4] * 10).known()
    assert far.error > 5.0 * near.error


def test_one_image_has_the_scatter_of_the_calibration():
    assert learned([0.0]).known().error == pytest.approx(CURVE.scatter[0])


def test_what_comes_long_after_a_shaking_event_teaches_nothing():
    early = learned([0.1] * 16, step=0.2)
    late = learned([0.1] * 16 + [0.5] * 50, step=0.2)
    assert late.known() == early.known()


@pytest.mark.parametrize('late', [{'before': False}, {'cycle': 0, 'before': False}])
def test_a_cycle_whose_start_was_not_seen_teaches_nothing(late):
    assert learned([0.1] * 10, **late).known() is None


def test_images_from_a_merge_on_that_is_known_later_are_forgotten():
    offset = learned([0.1] * 5 + [0.4] * 5)
    offset.forget(2, 10 * NS)
    assert offset.known().value == pytest.approx(0.25)
    offset.forget(1, 11 * NS)
    assert offset.known().value == pytest.approx(0.1)


def test_a_later_cycle_keeps_what_an_earlier_one_taught():
    offset = learned([0.1] * 10)
    offset.follow(2, 40 * NS)
    assert offset.known().value == pytest.approx(0.1)


@pytest.mark.parametrize(
    ('weighted_size', 'single'),
    [
        (Measured(1.0, 0.0), True),
        (Measured(1.0, 0.05), True),
        (Measured(1.0, 1.0), False),
        (Measured(1.13, 0.0), False),
        (Measured(), False),
    ],
)
def test_beads_are_single_if_tracks_say_so_and_pairs_they_doubt_would_not_show(
    weighted_size, single
):
    assert ReadingOffset(CURVE).certainly_single(weighted_size) is single


def test_with_the_offset_sizes_are_those_of_a_camera_as_in_the_calibration():
    for size in (1.0, 2.0, 6.0):
        reading = float(np.interp(math.log(size), CURVE.log_size, CURVE.reading))
        own = CURVE.size_at(reading)
        shifted = CURVE.size_at(reading + 0.12, learned([0.12] * 15).known())
        assert shifted.size == pytest.approx(own.size, rel=1e-6)
        assert shifted.lower <= own.lower
        assert shifted.upper >= own.upper
