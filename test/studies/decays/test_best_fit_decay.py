"""The simulated decay that agrees best with measured ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from decays import TIMES, simulated_table

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import (
    Measured,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator
from nanorocks_ros.studies.decays.best_fit_decay import library_decay
from nanorocks_ros.studies.decays.cooling_curves import mean_cycle, read_cycles

TRAY = load_trays()[1]
NS = 1_000_000_000


@pytest.fixture(scope='module')
def cycles(tmp_path_factory):
    return read_cycles(simulated_table(tmp_path_factory.mktemp('a') / 'a.csv', 12))


def test_it_goes_through_the_speeds_and_its_intervals_hold_the_truth(cycles):
    curve = mean_cycle(cycles, 0.5, 20.0)
    decay = library_decay(TRAY, cycles, curve)
    # It has to be as late as the stage is.
    assert decay.times[0] == pytest.approx(1.8)
    measured = np.interp(decay.times, curve.times, curve.speed)
    assert np.abs(np.log(decay.speed / measured)).max() < 0.15
    assert abs(np.log(decay.speed / measured).mean()) < 0.01
    # Mean speed in space times pi/4.
    assert decay.initial_speed == pytest.approx(0.25 * np.pi * 0.007, rel=0.15)
    _, lower, upper = decay.restitution
    assert lower < 0.89 < upper
    assert decay.wall_restitution[1] < 0.99


def test_it_says_of_a_cycle_what_the_stage_says(cycles):
    cycle = cycles[0]
    stage = RestitutionEstimator(PipelineSettings(), TRAY)
    for time, speed in zip(cycle.times, cycle.speed, strict=True):
        stage.push(
            SpeedEstimate(
                stamp_ns=round(time * NS),
                tray=1,
                cycle=1,
                cycle_start_ns=0,
                mean_projected_speed=Measured(float(speed), 1e-4),
                window=0.3,
                method=SpeedMethod.TRACKING,
            )
        )
        if time > 19.95:
            break
    (final,) = stage.flush()
    decay = library_decay(TRAY, [cycle], mean_cycle([cycle], 1.75, 20.0))
    assert decay.restitution[0] == pytest.approx(final.restitution.value, abs=2e-3)
    assert decay.wall_restitution[0] == pytest.approx(final.wall_restitution.value, abs=2e-3)


def test_a_gas_on_a_tray_that_swung_is_nearly_as_old_as_one_at_rest(cycles):
    curve = mean_cycle(cycles, 5.75, 20.0)
    still = library_decay(TRAY, cycles, curve)
    swung = library_decay(TRAY, cycles, curve, start=4.0)
    np.testing.assert_array_equal(swung.times, still.times)
    lower, upper = still.restitution[1:]
    assert swung.restitution[0] == pytest.approx(still.restitution[0], abs=0.1 * (upper - lower))
    assert swung.initial_speed == pytest.approx(still.initial_speed, rel=0.15)


def test_a_tray_without_a_library_and_a_decay_too_short_are_named(cycles):
    curve = mean_cycle(cycles, 0.5, 20.0)
    with pytest.raises(ConfigurationError, match='library'):
        library_decay(replace(TRAY, dimensions=(0.02, 0.02, 0.003)), cycles, curve)
    short = replace(
        cycles[0], times=TIMES[:5], speed=cycles[0].speed[:5], error=cycles[0].error[:5]
    )
    with pytest.raises(FitError, match='too short'):
        library_decay(TRAY, [short], curve)
