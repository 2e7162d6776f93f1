"""Pictures and tracks together: one estimate of the clusters at each instant."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from sticking_records import NS, TRAY, cooling, ns

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import (
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    Measured,
    Merge,
    Quality,
    SpeedEstimate,
    StickingStatus,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.clusters.cluster_estimator import ClusterEstimator


def images(until, step=0.1):
    """Of one and the same picture."""
    gray = np.random.default_rng(1).integers(90, 140, (60, 60), dtype=np.uint8)
    return [
        TrayImage(stamp_ns=ns(t), tray=1, gray=gray, cycle=1, cycle_start_ns=0, noise_power=4.0)
        for t in np.arange(step, until, step)
    ]


def estimates(records):
    stage = ClusterEstimator(PipelineSettings(), TRAY)
    results = [item for record in records for item in stage.push(record)]
    return [item for item in (*results, *stage.flush()) if isinstance(item, ClusterEstimate)]


def as_they_come(records, delays):
    """In the order in which they are known, some kinds later by some seconds."""

    def known_ns(record):
        stamp_ns = record.known_ns if isinstance(record, Merge) else record.stamp_ns
        return stamp_ns + ns(delays.get(type(record), 0.0))

    return sorted(records, key=known_ns)


@pytest.mark.parametrize('delay', [2.0, PipelineSettings().bodies.delay])
def test_estimates_come_a_second_after_what_tracks_say_of_the_instant(delay):
    settings = with_values(PipelineSettings(), {'bodies.delay': delay}, 'test')
    stage = ClusterEstimator(settings, TRAY)
    records = as_they_come([*cooling(until=20.0), *images(20.0)], {BodyEstimate: delay})
    true = {
        record.stamp_ns: record.bodies.value
        for record in records
        if isinstance(record, BodyEstimate)
    }
    first = min(record.stamp_ns for record in records if isinstance(record, Merge)) / NS
    seen = 0
    for record in records:
        for item in stage.push(record):
            if isinstance(item, ClusterEstimate):
                seen += 1
                assert record.stamp_ns - item.stamp_ns >= (delay + 1.0) * NS
                assert item.bodies.value == true[item.stamp_ns]
                assert math.isnan(item.onset) == (item.stamp_ns < first * NS)
    assert seen > 40
    (*_, last) = stage.flush()
    assert last.onset == pytest.approx(first)
    assert last.sticking_status is StickingStatus.MEASURED
    assert last.sticking_speed.lower < last.sticking_speed.value < last.sticking_speed.upper


def test_they_do_not_depend_on_the_order_in_which_records_come_in():
    records = [*cooling(until=12.0), *images(12.0)]
    delay = PipelineSettings().bodies.delay
    estimate = estimates(as_they_come(records, {BodyEstimate: delay}))
    other = estimates(as_they_come(records, {BodyEstimate: delay + 0.6, Merge: 0.9}))
    assert [repr(item) for item in estimate] == [repr(record) for record in other]


def test_without_tracks_the_autocorrelation_speaks_alone():
    results = estimates(images(5.0))
    assert len(results) > 20
    for record in results:
        assert math.isnan(record.bodies.value)
        assert math.isnan(record.onset)
        assert record.sticking_status is StickingStatus.UNKNOWN
        assert record.level_area > 0.0


def test_sizes_by_both_are_weighted_by_their_errors():
    (body, *_) = (record for record in cooling() if isinstance(record, BodyEstimate))
    by_tracks = [
        replace(body, stamp_ns=image.stamp_ns, weighted_size=Measured(3.0, 0.5))
        for image in images(5.0)
    ]
    for estimate in estimates(as_they_come([*images(5.0), *by_tracks], {})):
        known = math.isfinite(estimate.cluster_size.value)
        weights = np.array([4.0, 1.0 / estimate.cluster_size.error**2 if known else 0.0])
        sizes = np.array([3.0, estimate.cluster_size.value if known else 0.0])
        assert estimate.combined_size.value == pytest.approx(weights @ sizes / weights.sum())
        assert estimate.combined_size.error == pytest.approx(weights.sum() ** -0.5)


def test_the_image_is_sent_at_once_while_somebody_looks():
    stage = ClusterEstimator(PipelineSettings(), TRAY)
    stage.emit_image = True
    records = [(item, record) for record in images(3.0) for item in stage.push(record)]
    pictures = [(item, record) for item, record in records if isinstance(item, Autocorrelation)]
    assert pictures
    assert all(autocorrelation.stamp_ns == record.stamp_ns for autocorrelation, record in pictures)


def test_time_that_goes_back_gives_out_what_was_held():
    stage = ClusterEstimator(PipelineSettings(), load_trays()[1])
    once = [item for record in images(5.0) for item in stage.push(record)]
    back = stage.push(images(0.3)[0])
    held = [item for item in back if isinstance(item, ClusterEstimate)]
    stamps = [
        estimate.stamp_ns for estimate in (*once, *held) if isinstance(estimate, ClusterEstimate)
    ]
    assert stamps == sorted(stamps)
    assert stamps[-1] > ns(4.5)


def test_where_the_scale_is_wrong_nothing_is_said_of_clusters_and_sticking():
    records = as_they_come([*cooling(until=12.0), *images(12.0)], {})
    assert math.isfinite(estimates(records)[-1].sticking_speed.value)
    wrong = [
        replace(record, quality=Quality.WRONG_SCALE)
        if isinstance(record, TrayImage | SpeedEstimate)
        else record
        for record in records
    ]
    results = estimates(wrong)
    assert len(results) > 40
    for item in results:
        assert math.isnan(item.cluster_size.value)
        assert math.isnan(item.combined_size.value)
        assert math.isnan(item.bodies.value)
        assert math.isnan(item.onset)
        assert item.sticking_status is StickingStatus.UNKNOWN
        assert math.isnan(item.sticking_speed.value)


def test_a_cycle_with_a_wrong_scale_tells_no_sticking_speed_even_once_it_is_right_again():
    records = as_they_come([*cooling(until=12.0), *images(12.0)], {})
    first = next(k for k, record in enumerate(records) if isinstance(record, SpeedEstimate))
    records[first] = replace(records[first], quality=Quality.WRONG_SCALE)
    stage = ClusterEstimator(PipelineSettings(), TRAY)
    results = [item for record in records for item in stage.push(record)]
    assert {item.sticking_status for item in results if isinstance(item, ClusterEstimate)} == {
        StickingStatus.UNKNOWN
    }
    assert stage.cycles == ()
