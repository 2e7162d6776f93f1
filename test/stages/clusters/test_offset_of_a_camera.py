"""Single beads that look as broad as clusters of the calibration calibrate the autocorrelation."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from sticking_records import TRAY, count, merge, ns

from nanorocks_ros.records import (
    ClusterEstimate,
    Measured,
    Merge,
    SizeStatus,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.clusters.cluster_estimator import ClusterEstimator

SCALE = 13500.0
DIAMETER = TRAY.diameter * SCALE
CORNERS = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, math.sqrt(0.75))]) * DIAMETER


def picture(seed, beads):
    """Bodies of up to three beads: flat discs without shadow or blur, broader than simulated."""
    rng = np.random.default_rng(seed)
    side = round(TRAY.dimensions[0] * SCALE)
    places = np.empty((0, 2))
    while len(places) < TRAY.count:
        angle = rng.uniform(0.0, 2.0 * math.pi)
        turn = np.array([(math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))])
        body = rng.uniform(0.0, side, 2) + CORNERS[:beads] @ turn.T
        distances = np.linalg.norm(body[:, None] - places, axis=2)
        if (np.abs(body - side / 2) < side / 2 - DIAMETER / 2).all() and (
            distances > DIAMETER
        ).all():
            places = np.concatenate((places, body))
    gray = np.full((side, side), 160, np.uint8)
    for place in places:
        centre = tuple(round(16 * pixel) for pixel in place)
        cv2.circle(gray, centre, round(8 * DIAMETER), 60, -1, cv2.LINE_AA, 4)
    return gray


def image(time, beads, cycle):
    gray = picture(round(100 * time), beads)
    return TrayImage(
        stamp_ns=ns(time), tray=1, gray=gray, cycle=cycle, cycle_start_ns=0, noise_power=4.0
    )


def bodies(time, size, cycle):
    counted = count(time, TRAY.count / size, cycle)
    return replace(counted, weighted_size=Measured(float(size), 0.0))


def estimates(records):
    stage = ClusterEstimator(PipelineSettings(), TRAY)
    results = [item for record in records for item in stage.push(record)]
    return [item for item in (*results, *stage.flush()) if isinstance(item, ClusterEstimate)]


def film(sizes, cycles):
    """Records of images five times a second with the beads of each body and the cycle."""
    records = []
    for index, (size, cycle) in enumerate(zip(sizes, cycles, strict=True)):
        time = 1.0 + 0.2 * index
        records += [bodies(time, size, cycle), image(time, size, cycle)]
        if size > 1 and sizes[index - 1] == 1:
            records.insert(-1, merge(time, cycle))
    return sorted(records, key=known_ns)


def known_ns(record):
    return record.known_ns if isinstance(record, Merge) else record.stamp_ns


def test_single_beads_by_the_tracks_are_single_by_the_autocorrelation():
    results = estimates(film([1] * 40, [0] * 5 + [1] * 35))
    assert len(results) == 40
    for estimate in results[5:]:
        assert estimate.size_status is SizeStatus.MEASURED
        assert estimate.cluster_size.lower == pytest.approx(1.0)
        assert estimate.cluster_size.value < 1.6
        assert estimate.combined_size.value < 1.6


def test_without_single_beads_after_a_shaking_event_the_size_is_contradicted():
    for estimate in estimates(film([1] * 20, [0] * 20)):
        assert estimate.size_status is SizeStatus.CONTRADICTED
        assert math.isnan(estimate.cluster_size.value)
        assert estimate.cluster_size.lower > 1.2
        assert estimate.combined_size == Measured(1.0, pytest.approx(0.01))


@pytest.mark.parametrize('cycle', [1, 2])
def test_pairs_that_stick_in_this_cycle_or_at_once_in_the_next_are_measured(cycle):
    results = estimates(film([1] * 20 + [2] * 20, [0] * 5 + [1] * 15 + [cycle] * 20))[25:]
    sizes = [estimate.cluster_size for estimate in results]
    assert {estimate.size_status for estimate in results} == {SizeStatus.MEASURED}
    assert np.median([size.value for size in sizes]) == pytest.approx(2.0, rel=0.3)
    assert np.mean([size.lower < 2.0 < size.upper for size in sizes]) > 0.68


def test_clusters_that_the_tracks_miss_are_not_taken_for_single_beads():
    records = [
        replace(record, weighted_size=Measured(1.0, 0.0)) if hasattr(record, 'sizes') else record
        for record in film([1] * 20 + [3] * 20, [0] * 5 + [1] * 35)
        if not isinstance(record, Merge)
    ]
    for estimate in estimates(records)[25:]:
        assert estimate.cluster_size.lower > 1.5


def test_an_estimate_does_not_depend_on_later_images():
    sizes, cycles = [1] * 15 + [2] * 15, [0] * 5 + [1] * 25
    whole = estimates(film(sizes, cycles))
    part = estimates(film(sizes[:20], cycles[:20]))
    # The last two seconds wait for merges, which would be known by then.
    assert [repr(estimate) for estimate in part[:10]] == [
        repr(estimate) for estimate in whole[:10]
    ]
