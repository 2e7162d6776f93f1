"""The calibration of the binarised area by marked beads, and the closed form after it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.paper_formulas import paper_restitution_of_decay
from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE
from nanorocks_ros.studies.reproduction.marked_calibration import (
    area_series,
    calibrated,
    calibrated_restitution,
    marked_fit,
)

TRAY = load_trays()[1]
START, HAFF_TIME = 7e-3, 4.0
FACTOR, OFFSET = 1.6, -4e-4


def speed(time):
    return START / (1.0 + np.asarray(time) / HAFF_TIME)


def cycle_with(area):
    """A cycle whose area says `area` (a function of the true speed) where beads obey Haff."""
    times = np.arange(-0.5, 22.0, 0.2)
    after = np.clip(times, 0.0, None)
    seen = times[::2]
    return CycleFiles(
        folder=Path(),
        kind='bouncing',
        summary={
            'truth': {
                '1': {
                    'time': list(times + FIRST_SHAKE),
                    'marked_speed': list(np.where(times > 0.0, speed(after), 0.0)),
                }
            },
            'paper': {
                'trays': {
                    '1': {
                        'time': list(seen + FIRST_SHAKE),
                        'mean_projected_speed': list(area(speed(np.clip(seen, 0.0, None)))),
                        'mean_projected_speed_error': [1e-4] * len(seen),
                    }
                }
            },
        },
    )


def linear(true_speed):
    return (true_speed - OFFSET) / FACTOR


def test_the_calibration_takes_up_factor_and_offset_of_the_area():
    cycle = cycle_with(linear)
    fit = marked_fit(cycle, TRAY)
    assert fit.factor == pytest.approx(FACTOR, rel=0.02)
    assert fit.offset == pytest.approx(OFFSET, abs=5e-5)
    series = calibrated(area_series(cycle, 1), fit)
    assert series.times[0] > 0.0
    assert series.speed == pytest.approx(speed(series.times), rel=0.02)


def test_the_closed_form_is_applied_to_the_calibrated_decay():
    cycle = cycle_with(linear)
    # A later start is slower and has a longer Haff time: the same rate.
    expected = paper_restitution_of_decay(
        1.0 / (START * HAFF_TIME), TRAY.diameter, TRAY.number_density
    )
    restitution = calibrated_restitution(cycle, TRAY, marked_fit(cycle, TRAY))
    assert restitution == pytest.approx(expected, abs=0.003)
    constant = cycle_with(lambda true_speed: np.full_like(true_speed, 2e-3))
    assert np.isnan(calibrated_restitution(constant, TRAY, marked_fit(cycle, TRAY)))


def test_an_area_that_does_not_follow_the_speed_is_refused():
    rng = np.random.default_rng(1)
    cycle = cycle_with(lambda true_speed: rng.uniform(1e-3, 4e-3, true_speed.size))
    with pytest.raises(FitError, match='does not follow'):
        marked_fit(cycle, TRAY)
