"""Speeds in, restitutions out: provisional while cooling, final once per cycle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.experiment.settings import PipelineSettings, with_values
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff import haff_speed
from nanorocks_ros.physics.paper import paper_restitution_of_decay
from nanorocks_ros.records import CorStatus, SpeedEstimate, SpeedMethod
from nanorocks_ros.stages.cooling import HaffFitter

NS = 1_000_000_000
TRAY = load_trays()[1]


def fitter(**values):
    return HaffFitter(with_values(PipelineSettings(), values, 'test'), TRAY)


def speed(time, value, cycle=1, start=0.0):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=cycle,
        cycle_start_ns=round(start * NS) if cycle else None,
        mean_projected_speed=value,
        mean_projected_speed_error=0.02 * abs(value) + 1e-6,
        window=0.1,
        method=SpeedMethod.STRUCTURE_FUNCTION,
    )


def cooling_cycle(cycle=1, start=0.0, v0=6e-3, tau=5.0, until=25.0, noise=0.01):
    rng = np.random.default_rng(cycle)
    times = np.arange(0.1, until, 0.1)
    values = haff_speed(times, v0, tau) * np.exp(rng.normal(0, noise, times.size))
    return [speed(start + t, v, cycle, start) for t, v in zip(times, values, strict=True)]


def all_estimates(stage, speeds):
    return [one for item in speeds for one in stage.push(item)]


def test_a_decay_is_read_by_the_relation_that_is_named():
    *_, final = all_estimates(fitter(), cooling_cycle())
    expected = paper_restitution_of_decay(1 / (6e-3 * 5.0), TRAY.diameter, TRAY.number_density)
    assert final.status is CorStatus.FINAL
    assert final.restitution_lower < expected < final.restitution_upper
    assert final.initial_speed == pytest.approx(6e-3, rel=0.02)
    assert final.haff_time == pytest.approx(5.0, rel=0.04)


def test_the_interval_tightens_as_the_gas_cools():
    found = all_estimates(fitter(), cooling_cycle())
    widths = [one.restitution_upper - one.restitution_lower for one in found]
    assert len(found) > 20
    assert [one.status for one in found].count(CorStatus.FINAL) == 1
    assert widths[-1] < 0.2 * widths[0]


def test_a_cycle_that_the_next_shake_cuts_short_is_final_then():
    speeds = cooling_cycle(until=10.0) + cooling_cycle(cycle=2, start=10.0, until=3.0)
    finals = [one for one in all_estimates(fitter(), speeds) if one.status is CorStatus.FINAL]
    assert [one.cycle for one in finals] == [1]


def test_the_end_of_the_recording_ends_the_cycle():
    stage = fitter()
    all_estimates(stage, cooling_cycle(until=10.0))
    (final,) = stage.flush()
    assert final.status is CorStatus.FINAL
    assert stage.flush() == ()


def test_the_running_mean_is_over_the_final_estimates():
    stage = fitter()
    finals = []
    for cycle in (1, 2, 3):
        speeds = cooling_cycle(cycle, start=60.0 * (cycle - 1), noise=0.05)
        finals += [one for one in all_estimates(stage, speeds) if one.status is CorStatus.FINAL]
    values = [one.restitution for one in finals]
    assert finals[-1].mean_restitution == pytest.approx(np.mean(values))
    assert finals[-1].mean_restitution_error == pytest.approx(np.std(values, ddof=1) / 3**0.5)


def test_nothing_is_said_before_the_first_shake():
    speeds = [speed(t, 5e-3, cycle=0) for t in np.arange(0.1, 20.0, 0.1)]
    assert all_estimates(fitter(), speeds) == []


def test_speeds_that_rise_are_no_decay_and_the_interval_says_so():
    speeds = [speed(t, 1e-3 * (1 + t)) for t in np.arange(0.1, 25.0, 0.1)]
    *_, final = all_estimates(fitter(), speeds)
    assert final.status is CorStatus.NO_DECAY
    assert (final.restitution_lower, final.restitution_upper) == (0.0, 1.0)
    assert math.isnan(final.restitution)


def test_too_few_speeds_give_no_estimate():
    stage = fitter()
    assert all_estimates(stage, cooling_cycle(until=1.0)) == []
    assert stage.flush() == ()


def test_unknown_speeds_are_left_out():
    speeds = cooling_cycle()
    broken = [*speeds[:50], speed(5.05, math.nan), speed(5.06, 0.0), *speeds[50:]]
    *_, clean = all_estimates(fitter(), speeds)
    *_, other = all_estimates(fitter(), broken)
    assert other.restitution == clean.restitution


def test_time_that_goes_back_starts_all_afresh():
    stage = fitter()
    first = all_estimates(stage, cooling_cycle())
    again = all_estimates(stage, cooling_cycle())
    assert repr(again) == repr(first)


def test_the_asked_probability_widens_the_interval():
    *_, narrow = all_estimates(fitter(**{'cooling.probability': 0.68}), cooling_cycle())
    *_, wide = all_estimates(fitter(**{'cooling.probability': 0.95}), cooling_cycle())
    assert narrow.restitution == wide.restitution
    assert narrow.restitution_lower > wide.restitution_lower
