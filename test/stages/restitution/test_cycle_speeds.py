"""Which speeds of a cycle count, and which of their flags warn of its restitution."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Measured, Quality, SpeedEstimate, SpeedMethod
from nanorocks_ros.stages.restitution.cycle_speeds import certain_speeds, warnings_of

_SPEED = SpeedEstimate(
    stamp_ns=0,
    tray=7,
    cycle=1,
    cycle_start_ns=0,
    mean_projected_speed=Measured(1e-3, 5e-5),
    window=0.1,
    method=SpeedMethod.TRACKING,
)
_UNCERTAIN = replace(_SPEED, quality=Quality.UNCERTAIN)


@pytest.mark.parametrize('flag', [Quality.UNCERTAIN, Quality.FEW_BEADS])
def test_a_few_doubtful_speeds_from_tracks_are_left_out(flag):
    assert certain_speeds([_SPEED] * 96 + [replace(_SPEED, quality=flag)] * 4) == [_SPEED] * 96


def test_other_flags_of_a_single_speed_warn_of_the_cycle():
    speeds = [_SPEED] * 99 + [replace(_SPEED, quality=Quality.STABILISATION_LOST)]
    assert warnings_of(certain_speeds(speeds), load_trays()[7]) == Quality.STABILISATION_LOST


def test_many_uncertain_speeds_stay_with_their_flag():
    speeds = [_SPEED] * 90 + [_UNCERTAIN] * 10
    assert certain_speeds(speeds) == speeds
    assert warnings_of(certain_speeds(speeds), load_trays()[7]) == Quality.UNCERTAIN


def test_uncertain_speeds_of_the_structure_function_stay():
    doubtful = replace(_UNCERTAIN, method=SpeedMethod.STRUCTURE_FUNCTION)
    assert certain_speeds([_SPEED] * 99 + [doubtful])[-1] == doubtful


@pytest.mark.parametrize(
    ('tray', 'method', 'warns'),
    [
        (7, SpeedMethod.STRUCTURE_FUNCTION, False),
        (7, SpeedMethod.TRACKING, True),
        (6, SpeedMethod.STRUCTURE_FUNCTION, True),
        (8, SpeedMethod.STRUCTURE_FUNCTION, True),
        (5, SpeedMethod.STRUCTURE_FUNCTION, True),
    ],
)
def test_lost_beads_warn_unless_the_interval_carries_the_errors(tray, method, warns):
    speed = replace(_SPEED, method=method, quality=Quality.FEW_BEADS | Quality.GLARE)
    flags = warnings_of([speed], load_trays()[tray])
    assert flags == (Quality.FEW_BEADS | Quality.GLARE if warns else Quality.GLARE)
