"""Merges, bodies and speeds in; onset and sticking speed out."""

from __future__ import annotations

import numpy as np
import pytest
from sticking_records import NS, STICKING, TRAY, cooling, count, merge, ns, speed

from nanorocks_ros.records import BodyEstimate, Merge, SpeedEstimate, StickingStatus
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.clusters.sticking_estimator import StickingEstimator


def meter(records):
    stage = StickingEstimator(PipelineSettings(), TRAY)
    for record in records:
        stage.push(record)
    return stage


def test_the_onset_is_that_of_the_first_merge_once_it_happened():
    records = cooling()
    first = min(record.stamp_ns for record in records if isinstance(record, Merge)) / NS
    stage = meter(records)
    assert stage.onset(1, ns(first - 0.01)) is None
    assert stage.onset(1, ns(first)) == pytest.approx(first)
    assert stage.onset(1, ns(39.0)) == pytest.approx(first)
    assert stage.onset(2, ns(39.0)) is None


def test_a_merge_that_became_known_too_late_changes_nothing_said_of_before():
    delay = PipelineSettings().bodies.delay
    stage = meter([*cooling(sticking=0.0), merge(5.0, 1, known=delay + 2.0)])
    assert stage.onset(1, ns(6.0)) is None
    assert stage.onset(1, ns(7.1)) == pytest.approx(5.0)


def test_the_sticking_speed_is_found_and_cycles_together_tell_more():
    stage = StickingEstimator(PipelineSettings(), TRAY)
    estimates = []
    for cycle in range(1, 13):
        start = 60.0 * (cycle - 1)
        for record in cooling(cycle, start):
            stage.push(record)
        estimates.append(stage.of_cycle(cycle, ns(start + 39.9)))
        together = stage.of_all(cycle, ns(start + 39.9))
        assert (together is None) == (cycle == 1)
    # 95 % intervals, 12 of them.
    assert sum(estimate.lower < STICKING < estimate.upper for estimate in estimates) >= 10
    assert together.lower < STICKING < together.upper
    widths = [estimate.upper - estimate.lower for estimate in estimates]
    # What all of them have in common stays: the error of the rates.
    assert together.upper - together.lower < 0.8 * np.mean(widths)


def test_without_a_merge_there_is_an_upper_limit():
    estimate = meter(cooling(sticking=0.0)).of_cycle(1, ns(39.9))
    assert estimate.status is StickingStatus.NO_MERGE
    assert 0.0 < estimate.upper < 2e-3


def test_what_is_said_does_not_depend_on_the_order_in_which_records_came_in():
    records = cooling()
    later = sorted(
        records,
        key=lambda record: record.stamp_ns + (ns(1.5) if isinstance(record, BodyEstimate) else 0),
    )
    first, other = meter(records), meter(later)
    for time in (5.0, 20.0, 38.0):
        assert first.of_cycle(1, ns(time)) == other.of_cycle(1, ns(time))
        assert first.bodies(1, ns(time)).stamp_ns == other.bodies(1, ns(time)).stamp_ns


def test_where_nobody_counts_bodies_nothing_is_said():
    stage = meter([record for record in cooling() if isinstance(record, SpeedEstimate)])
    assert stage.of_cycle(1, ns(39.0)) is None
    assert stage.bodies(1, ns(39.0)) is None


def test_time_that_goes_back_starts_afresh():
    stage = meter([*cooling(), speed(1.0, 1e-3, 0, 0.0)])
    assert stage.onset(1, ns(39.0)) is None
    assert stage.of_all(2, ns(39.0)) is None


def test_of_a_tray_that_is_shaken_no_more_only_the_last_counts_are_kept():
    records = [count(time, TRAY.count - time / 1000.0, 1) for time in np.arange(0.0, 200.0, 0.5)]
    stage = meter([speed(0.5, 1e-3, 1, 0.0), *records])
    for back in (0.0, 5.0, 15.0):
        assert stage.bodies(1, ns(199.5 - back)) == records[-1 - round(2 * back)]
    assert stage.bodies(1, ns(100.0)) is None
