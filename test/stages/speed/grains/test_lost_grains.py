"""Grains that are lost in the course of a cycle count as slow ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.stages.speed.grains.lost_grains import LostGrains
from nanorocks_ros.stages.tracking.mean_speed import MeanSpeed

SPEED, ERROR = 1e-3, 5e-5


def mean_of(share):
    """A mean speed of a share of the grains."""
    return MeanSpeed(
        stamp_ns=0,
        mean_projected_speed=SPEED,
        mean_projected_speed_error=ERROR,
        window=0.5,
        beads=round(255 * share),
        share=share,
        reliable=True,
        beyond_errors=True,
        hidden=0.0,
    )


def counted(*shares):
    """The last of the mean speeds of growing time with these shares."""
    lost = LostGrains(1)
    for share in shares:
        (mean,) = lost.counted([mean_of(share)])
    return mean


def test_grains_that_a_camera_never_follows_change_nothing():
    assert counted(0.5, 0.5, 0.5) == mean_of(0.5)


def test_shares_may_grow_as_shaken_grains_slow_down():
    assert counted(0.3, 0.6) == mean_of(0.6)


def test_the_mean_is_that_of_lost_grains_of_a_quarter_to_five_quarters_of_the_speed():
    kept = 0.6 / 0.8
    speeds = SPEED * (kept + (1.0 - kept) * np.linspace(0.25, 1.25, 10_001))
    mean = counted(0.7, 0.8, 0.6)
    assert mean.mean_projected_speed == pytest.approx(speeds.mean())
    assert mean.mean_projected_speed_error == pytest.approx(math.hypot(ERROR, speeds.std()), 1e-3)


def test_each_species_has_its_own_share():
    lost = LostGrains(2)
    lost.counted([mean_of(0.8), mean_of(1.0)])
    few, all_of_it = lost.counted([mean_of(0.4), mean_of(1.0)])
    assert few.mean_projected_speed == pytest.approx(0.875 * SPEED)
    assert all_of_it == mean_of(1.0)


def test_a_moment_without_a_speed_stays_without():
    lost = LostGrains(2)
    assert lost.counted([None, mean_of(0.0)]) == [None, mean_of(0.0)]
