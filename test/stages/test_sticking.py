"""Merges, bodies and speeds in; onset and sticking speed out."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.settings import PipelineSettings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking import StickingStatus
from nanorocks_ros.physics.haff import haff_speed
from nanorocks_ros.physics.sticking import slow_contacts
from nanorocks_ros.records import BodyEstimate, Merge, SpeedEstimate, SpeedMethod
from nanorocks_ros.stages.sticking import StickingMeter

NS = 1_000_000_000
TRAY = load_trays()[1]
STICKING = 1.5e-3


def speed(time, value, cycle, start):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=cycle,
        cycle_start_ns=round(start * NS),
        mean_projected_speed=value,
        mean_projected_speed_error=0.02 * value,
        window=0.1,
        method=SpeedMethod.TRACKING,
    )


def count(time, bodies, cycle):
    return BodyEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=cycle,
        beads=TRAY.count,
        followed=TRAY.count,
        bodies=bodies,
        bodies_error=0.1,
        mean_size=TRAY.count / bodies,
        mean_size_error=0.1,
        weighted_size=TRAY.count / bodies,
        weighted_size_error=0.1,
        clustered_share=0.0,
        clustered_share_error=0.0,
        clusters=0.0,
        clusters_error=0.0,
        sizes=np.zeros(5),
    )


def cooling(cycle=1, start=0.0, seed=0, sticking=STICKING):
    """Records of a cycle in which bodies merge as often as kinetic theory says."""
    rng = np.random.default_rng([seed, cycle])
    contacts = slow_contacts(TRAY)
    bodies, found, step = float(TRAY.count), [], 0.1
    for time in np.arange(step, 40.0, step):
        value = float(haff_speed(time, 8e-3, 4.0))
        rate = 0.5 * bodies**2 / TRAY.count * value * float(contacts.slower(sticking / value))
        if bodies > 1.0 and rng.uniform() < rate * step:
            bodies -= 1.0
            found.append(merge(start + time, cycle))
        found += [speed(start + time, value, cycle, start), count(start + time, bodies, cycle)]
    return found


def merge(time, cycle, known=0.6):
    return Merge(
        stamp_ns=round(time * NS),
        known_ns=round((time + known) * NS),
        tray=1,
        cycle=cycle,
        tracks=np.array([1, 2], dtype=np.int32),
        joins=True,
    )


def meter(records):
    stage = StickingMeter(PipelineSettings(), TRAY)
    for one in records:
        stage.push(one)
    return stage


def ns(time):
    return round(time * NS)


def test_the_onset_is_that_of_the_first_merge_once_it_happened():
    records = cooling()
    first = min(one.stamp_ns for one in records if isinstance(one, Merge)) / NS
    stage = meter(records)
    assert stage.onset(1, ns(first - 0.01)) is None
    assert stage.onset(1, ns(first)) == pytest.approx(first)
    assert stage.onset(1, ns(39.0)) == pytest.approx(first)
    assert stage.onset(2, ns(39.0)) is None


def test_a_merge_that_became_known_too_late_changes_nothing_said_of_before():
    stage = meter([*cooling(sticking=0.0), merge(5.0, 1, known=3.0)])
    assert stage.onset(1, ns(6.0)) is None
    assert stage.onset(1, ns(7.1)) == pytest.approx(5.0)


def test_the_sticking_speed_is_found_and_cycles_together_tell_more():
    stage = StickingMeter(PipelineSettings(), TRAY)
    each = []
    for cycle in range(1, 13):
        start = 60.0 * (cycle - 1)
        for record in cooling(cycle, start):
            stage.push(record)
        each.append(stage.of_cycle(cycle, ns(start + 39.9)))
        together = stage.of_all(cycle, ns(start + 39.9))
        assert (together is None) == (cycle == 1)
    # 95 % intervals, 12 of them.
    assert sum(one.lower < STICKING < one.upper for one in each) >= 10
    assert together.lower < STICKING < together.upper
    widths = [one.upper - one.lower for one in each]
    assert together.upper - together.lower < 0.7 * np.mean(widths)


def test_without_a_merge_there_is_an_upper_limit():
    found = meter(cooling(sticking=0.0)).of_cycle(1, ns(39.9))
    assert found.status is StickingStatus.NO_MERGE
    assert 0.0 < found.upper < 2e-3


def test_what_is_said_does_not_depend_on_the_order_in_which_records_came_in():
    records = cooling()
    later = sorted(
        records, key=lambda one: one.stamp_ns + (ns(1.5) if isinstance(one, BodyEstimate) else 0)
    )
    one, other = meter(records), meter(later)
    for time in (5.0, 20.0, 38.0):
        assert one.of_cycle(1, ns(time)) == other.of_cycle(1, ns(time))
        assert one.bodies(1, ns(time)).stamp_ns == other.bodies(1, ns(time)).stamp_ns


def test_where_nobody_counts_bodies_nothing_is_said():
    stage = meter([one for one in cooling() if isinstance(one, SpeedEstimate)])
    assert stage.of_cycle(1, ns(39.0)) is None
    assert stage.bodies(1, ns(39.0)) is None


def test_time_that_goes_back_starts_afresh():
    stage = meter([*cooling(), speed(1.0, 1e-3, 0, 0.0)])
    assert stage.onset(1, ns(39.0)) is None
    assert stage.of_all(2, ns(39.0)) is None
