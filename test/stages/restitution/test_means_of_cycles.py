"""Decays that contacts contradict do not enter the means, unless asked; their contacts do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from wall_rebounds import wall_rebounds

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.records import (
    CorStatus,
    Headline,
    Measured,
    Quality,
    SpeedEstimate,
    SpeedMethod,
)
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
    last = {}
    for cycle, haff_time, wall in ((1, 3.0, 0.82), (2, 20.0, 0.82), (3, 3.0, 0.82)):
        records = [*speeds(cycle, haff_time), *rebounds(cycle, wall)]
        for record in sorted(records, key=lambda item: item.stamp_ns):
            last |= {cor.cycle: cor for cor in stage.push(record)}
    last |= {cor.cycle: cor for cor in stage.flush()}
    return [last[cycle] for cycle in (1, 2, 3)]


@pytest.mark.parametrize('include', [False, True])
def test_a_decay_that_contacts_contradict_enters_the_mean_only_when_asked(include):
    first, tense, last = final_estimates(include=include)
    assert first.headline is last.headline is Headline.JOINT
    assert not first.quality & Quality.INCONSISTENT
    assert tense.quality & Quality.INCONSISTENT
    # Rebounds alone tell the walls, and nothing tells the beads.
    assert tense.headline is Headline.CONTACTS
    assert tense.status is CorStatus.UNDETERMINED
    assert tense.wall_restitution == tense.contact_wall_restitution
    assert tense.wall_restitution.lower < 0.82 < tense.wall_restitution.upper
    # All sources are given beside it.
    assert math.isnan(tense.contact_restitution.value)
    assert tense.joint_restitution.lower > first.restitution.upper
    assert math.isfinite(tense.decay_restitution.value)
    # Rebounds of all cycles count; the decay only when asked, and the mean is then tense, too.
    assert tense.mean_wall_restitution.error < first.mean_wall_restitution.error
    assert math.isnan(tense.mean_restitution.value) == include
    if not include:
        shift = tense.mean_restitution.value - first.mean_restitution.value
        assert abs(shift) < first.mean_restitution.error
        assert last.mean_restitution.error < first.mean_restitution.error
