"""Cycles flagged inconsistent do not enter the means, unless asked."""

from __future__ import annotations

import math

import numpy as np
import pytest
from wall_rebounds import wall_rebounds

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.records import CorStatus, Measured, Quality, SpeedEstimate, SpeedMethod
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

NS = 1_000_000_000
PERIOD = 40.0


def speeds(cycle, haff_time):
    rng = np.random.default_rng(cycle)
    start = cycle * PERIOD
    for time in np.arange(0.1, 25.0, 0.1):
        value = haff_speed(time, 6e-3, haff_time) * math.exp(rng.normal(0.0, 0.01))
        yield SpeedEstimate(
            stamp_ns=round((start + time) * NS),
            tray=1,
            cycle=cycle,
            cycle_start_ns=round(start * NS),
            mean_projected_speed=Measured(value, 0.02 * value),
            window=0.1,
            method=SpeedMethod.TRACKING,
        )


def rebounds(cycle, wall):
    rng = np.random.default_rng(100 + cycle)
    first = cycle * PERIOD
    return wall_rebounds(rng, 60, first + 2.0, first + 18.0, wall, error=1e-5)


def final_estimates(*, include):
    """Two cycles that agree; between them one that cools more slowly than rebounds allow."""
    settings = with_values(PipelineSettings(), {'cooling.include_inconsistent': include}, 'test')
    stage = RestitutionEstimator(settings, load_trays()[1])
    finals = []
    for cycle, haff_time, wall in ((1, 6.0, 0.985), (2, 20.0, 0.82), (3, 6.0, 0.985)):
        records = [*speeds(cycle, haff_time), *rebounds(cycle, wall)]
        for record in sorted(records, key=lambda item: item.stamp_ns):
            finals += [cor for cor in stage.push(record) if cor.status is CorStatus.FINAL]
    return [*finals, *stage.flush()]


@pytest.mark.parametrize('include', [False, True])
def test_an_inconsistent_cycle_enters_the_mean_only_when_asked(include):
    first, tense, last = final_estimates(include=include)
    assert not first.quality & Quality.INCONSISTENT
    assert tense.quality & Quality.INCONSISTENT
    assert not last.quality & Quality.INCONSISTENT
    changed = tense.mean_restitution != first.mean_restitution
    assert changed == include
    # What the cycle itself says is not changed by that.
    assert math.isfinite(tense.restitution.value)
    assert last.mean_restitution != first.mean_restitution
