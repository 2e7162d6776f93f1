"""Plans of sweeps: what cannot be simulated is refused, and each run has its own number."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan

SETTINGS = SimulationSettings(seed=7)
AXES = {'restitution': (0.7, 0.8, 0.9), 'wall_restitution': (0.9, 0.99)}
TIMES = (0.0, 0.5, 2.0, 6.0)


@pytest.mark.parametrize(
    ('axes', 'message'),
    [
        ({'restitutoin': (0.5,)}, "no setting 'restitutoin'"),
        ({'restitution': (0.5, math.nan)}, 'nan is not finite'),
        ({'restitution': (0.5, 1.5)}, r'1.5 is outside \[0, 1\]'),
        ({'restitution': (0.5, 0.5)}, 'holds a value twice; give each value once'),
        ({'restitution': ()}, 'has no values; give one or more'),
        ({'restitution': ('a',)}, "'a' is not a number"),
        ({'tray': (1.5,)}, '1.5 is not a whole number'),
        ({'tray': (9,)}, r'9 is outside \[1, 8\]'),
        ({'restitution': np.linspace(0, 1, 2000), 'noise': np.linspace(0, 1, 2000)}, 'at most'),
    ],
)
def test_axes_that_cannot_be_are_refused(axes, message):
    with pytest.raises(ConfigurationError, match=message):
        sweep_plan(SETTINGS, axes, TIMES, 2)


@pytest.mark.parametrize('times', [(), (1.0, 1.0), (2.0, 1.0), (-1.0,), (math.nan,), ('a',)])
def test_times_that_cannot_be_are_refused(times):
    with pytest.raises(ConfigurationError, match=r'--times: .*give'):
        sweep_plan(SETTINGS, {}, times, 2)


@pytest.mark.parametrize('runs', [0, -1, 1.5, True, 2**40])
def test_numbers_of_runs_that_cannot_be_are_refused(runs):
    with pytest.raises(ConfigurationError, match=r'--runs: .*give a whole number'):
        sweep_plan(SETTINGS, {}, TIMES, runs)


def test_settings_that_cannot_be_are_refused():
    with pytest.raises(ConfigurationError, match=r'noise: -1.0 is outside'):
        sweep_plan(replace(SETTINGS, noise=-1.0), {}, TIMES, 2)


def test_no_two_runs_share_a_number():
    plan = sweep_plan(SETTINGS, AXES, TIMES, 20)
    numbers = [number for point in range(6) for number in plan.run_numbers(point, 0, 20)]
    assert len(set(numbers)) == 120
