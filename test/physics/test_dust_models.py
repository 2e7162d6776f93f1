"""Sticking thresholds as published, with what is not verified marked."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.dust_models import (
    ALWAYS_BOUNCING,
    ALWAYS_STICKING,
    CURVES,
    PAPER_STICKING_SPEEDS,
    STICKING_SEEN,
    MeasuredThreshold,
    ThresholdCurve,
    collapse_time_factor,
)

PAPER = json.loads((Path(__file__).parents[1] / 'paper_values.json').read_text())
GRAM, CENTIMETRE = 1e-3, 1e-2


def test_the_papers_thresholds_are_those_printed():
    printed = PAPER['sticking_onset']['relative_speed_mm_s']
    assert {str(k): pytest.approx(1e3 * v) for k, v in PAPER_STICKING_SPEEDS.items()} == printed


def test_unverified_curves_are_marked_in_their_labels():
    for curve in CURVES:
        assert not curve.verified
        assert 'unverified' in curve.label
        assert 'Windmark 2012' in curve.label


def test_a_curve_that_was_checked_carries_no_mark():
    checked = ThresholdCurve(
        name='a', mass=1.0, speed=1.0, exponent=-0.75, source='b', verified=True
    )
    assert checked.label == 'a: b'


def test_thresholds_at_masses_of_the_trays_are_as_computed_by_hand():
    # (4.94e-3 g / 3.3e-3 g)^(-5/18) cm/s, and for a bead of glass of 1.47 mg.
    speeds = ALWAYS_BOUNCING.threshold(np.array([4.942772e-3, 1.466e-3]) * GRAM) / CENTIMETRE
    assert speeds == pytest.approx([0.89385, 1.2527], rel=1e-3)


@given(some.floats(1e-12, 1e-2), some.floats(1.1, 1e3))
def test_heavier_particles_stick_only_when_slower_by_the_power(mass, heavier):
    for curve in CURVES:
        ratio = curve.threshold(heavier * mass) / curve.threshold(mass)
        assert ratio == pytest.approx(heavier ** (-5 / 18))
    assert ALWAYS_STICKING.threshold(mass) < ALWAYS_BOUNCING.threshold(mass)


@pytest.mark.parametrize('mass', [0.0, -1.0, math.nan, math.inf])
def test_a_mass_that_is_not_positive_is_refused(mass):
    with pytest.raises(ConfigurationError, match='mass'):
        ALWAYS_BOUNCING.threshold(mass)


def test_the_published_range_of_sticking_speeds_contains_the_papers_thresholds():
    for speed in PAPER_STICKING_SPEEDS.values():
        assert STICKING_SEEN.lower < speed < STICKING_SEEN.upper


def test_a_cloud_of_the_papers_beads_collapses_five_times_as_slowly():
    printed = PAPER['other_numbers']['collapse_time_factor_at_0.89']
    assert collapse_time_factor(0.89) == pytest.approx(printed)
    assert collapse_time_factor(0.89) == pytest.approx(5, abs=0.2)


def test_a_collapse_is_no_slower_without_bouncing_and_never_ends_without_loss():
    assert collapse_time_factor(0.0) == 1.0
    assert collapse_time_factor(1.0) == math.inf


@pytest.mark.parametrize('restitution', [-0.1, 1.1, math.nan])
def test_a_restitution_outside_0_to_1_is_refused(restitution):
    with pytest.raises(ConfigurationError, match='from 0 to 1'):
        collapse_time_factor(restitution)


@pytest.mark.parametrize(
    'change',
    [{'lower': 0.02}, {'upper': 0.005}, {'speed': 0.0}, {'mass': -1.0}, {'upper': math.nan}],
)
def test_a_threshold_outside_its_interval_is_refused(change):
    numbers = {
        'mass': 5e-6,
        'lightest': 5e-6,
        'heaviest': 5e-6,
        'speed': 0.01,
        'lower': 0.009,
        'upper': 0.011,
    }
    with pytest.raises(ConfigurationError):
        MeasuredThreshold(tray=1, source='measured', **{**numbers, **change})
