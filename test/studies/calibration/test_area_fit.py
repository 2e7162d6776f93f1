"""The line through speeds by the binarised area and by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import FitError
from nanorocks_ros.studies.calibration.area_fit import SpeedPair, fit_area

FACTOR, OFFSET = 0.6, 0.4e-3
N = 15


def pairs(count=30, low=1e-3, high=8e-3, noise=0.1, seed=1, factor=FACTOR, offset=OFFSET):
    """Speeds by hand on a line over those by the area, with errors as they are stated."""
    rng = np.random.default_rng(seed)
    speed_pairs = []
    for k, area in enumerate(np.linspace(low, high, count)):
        true = factor * area + offset
        speed_pairs.append(
            SpeedPair(
                stamp_ns=k,
                area_speed=float(area),
                area_speed_error=0.0,
                manual_speed=float(true * (1.0 + noise * rng.normal())),
                manual_speed_error=float(noise * true),
                beads=N,
            )
        )
    return speed_pairs


def test_a_line_is_found_within_its_errors():
    off = []
    for seed in range(40):
        fit = fit_area(pairs(seed=seed), N, 'test')
        off.append(
            (
                (fit.factor - FACTOR) / fit.factor_error,
                (fit.offset - OFFSET) / fit.offset_error,
            )
        )
    assert np.abs(np.mean(off, axis=0)).max() < 0.6
    assert 0.6 < np.std(off) < 1.4


def test_exact_speeds_give_an_exact_line():
    fit = fit_area(pairs(noise=1e-6), N, 'test')
    assert fit.factor == pytest.approx(FACTOR, rel=1e-4)
    assert fit.offset == pytest.approx(OFFSET, rel=1e-3)
    assert fit.windows == 30
    assert fit.slowest == pytest.approx(FACTOR * 1e-3 + OFFSET, rel=1e-4)


@pytest.mark.parametrize('change', [{'count': 6}, {'low': 5e-3, 'high': 6e-3}])
def test_few_windows_or_a_narrow_range_give_a_factor_alone(change):
    fit = fit_area(pairs(noise=0.02, offset=0.0, **change), N, 'test')
    assert fit.factor == pytest.approx(FACTOR, rel=0.05)
    assert fit.offset == 0.0
    assert math.isnan(fit.offset_error)


def test_beads_that_were_not_marked_leave_an_error_that_more_windows_do_not_take_away():
    # 4 of 15 beads, each with a speed of its own that scatters as in a gas.
    rng = np.random.default_rng(2)
    spread = np.std([rng.permutation(rng.rayleigh(1.0, N))[:4].mean() for _ in range(4000)])
    spread /= np.sqrt(np.pi / 2.0)
    # That is beside the mean of all 15, which scatters itself.
    sampling_error = np.std([rng.rayleigh(1.0, N).mean() for _ in range(4000)]) / np.sqrt(
        np.pi / 2.0
    )
    expected = FACTOR * np.sqrt(spread**2 - sampling_error**2)
    few = [replace(pair, beads=4) for pair in pairs(count=2000, noise=0.05)]
    assert fit_area(few, N, 'test').factor_error == pytest.approx(expected, rel=0.1)


def test_scatter_beyond_the_stated_errors_makes_the_error_larger():
    stated = pairs(noise=0.05)
    sure = [replace(pair, manual_speed_error=0.2 * pair.manual_speed_error) for pair in stated]
    fit = fit_area(sure, N, 'test')
    assert fit.reduced_chi_square > 10.0
    # A fifth of it, did it rest on what the speeds say of themselves.
    assert fit.factor_error > 0.6 * fit_area(stated, N, 'x').factor_error


def test_too_few_windows_are_refused_with_their_number():
    with pytest.raises(FitError, match='tray 3: the tracks cover 4 windows, 5 are needed'):
        fit_area(pairs(count=4), N, 'tray 3')


def test_an_area_that_does_not_follow_the_speed_is_refused():
    unrelated = pairs(factor=0.0, offset=3e-3)
    with pytest.raises(FitError, match='does not follow the speed of the tracks'):
        fit_area(unrelated, N, 'test')


def test_a_calibration_beyond_the_range_of_the_settings_is_refused():
    with pytest.raises(FitError, match='cannot be a calibration; see that --first-frame'):
        fit_area(pairs(factor=2000.0, offset=0.0), N, 'test')
