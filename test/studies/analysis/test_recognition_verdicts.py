"""Verdicts on the recognition: a sentence, flags with remedies, and whether it can be used."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.recognition_counts import SpeciesCounts
from nanorocks_ros.studies.analysis.recognition_verdicts import (
    Scenery,
    recognition_verdict,
    recognition_verdicts,
    scenery_of,
    verdict_as_json,
)

GOOD = SpeciesCounts(
    tray=1,
    material='steel',
    expected=24,
    followed=True,
    frames=300,
    seen=23.98,
    tracked=24.0,
    complete=0.98,
    tracks=24,
    track_length=300.0,
    at_rest=0.0,
    overlapping=0.0,
    near_limit=0.0,
    max_speed=0.05,
    wrong_scale=0.0,
)


def names(verdict):
    return [flag.name for flag in verdict.flags]


def test_beads_that_are_nearly_always_seen_are_usable():
    verdict = recognition_verdict(GOOD)
    assert verdict.lines() == ['tray 1, steel: all 24 beads seen in 98 % of frames: usable']


@pytest.mark.parametrize(
    ('changes', 'flag', 'usable'),
    [
        ({'seen': 0.0, 'complete': 0.0}, 'nothing_seen', False),
        ({'seen': 8.0, 'complete': 0.0}, 'few_seen', False),
        ({'seen': 19.0, 'complete': 0.0}, 'few_seen', True),
        ({'seen': 72.0, 'complete': 1.0}, 'too_many_seen', False),
        ({'at_rest': 0.8}, 'never_move', False),
        ({'overlapping': 0.5}, 'elongated', False),
        ({'near_limit': 0.03}, 'speed_limit', True),
        ({'near_limit': 0.2}, 'speed_limit', False),
        ({'wrong_scale': 0.9}, 'wrong_scale', False),
        ({'track_length': 2.0}, 'short_tracks', False),
        ({'spread_exponent': 1.0}, 'diffusive', True),
        ({'diameter_ratio': 1.14}, 'other_size', True),
        ({'diameter_ratio': 0.78}, 'other_size', False),
    ],
)
def test_each_fault_has_a_flag_and_a_remedy(changes, flag, usable):
    verdict = recognition_verdict(replace(GOOD, **changes))
    assert names(verdict) == [flag]
    assert verdict.usable is usable
    assert all(row.text and row.remedy for row in verdict.flags)


def test_the_verdict_names_its_flags():
    fast = replace(GOOD, near_limit=0.03)
    assert recognition_verdict(fast).lines()[0].endswith(': usable with care (speed_limit)')
    other = replace(fast, diameter_ratio=0.7)
    line = recognition_verdict(other).lines()[0]
    assert line.endswith(': NOT USABLE (other_size, speed_limit)')


def test_three_times_too_many_is_said_as_a_share():
    verdict = recognition_verdict(replace(GOOD, expected=1, seen=3.0, complete=1.0))
    assert verdict.text == 'tray 1, steel: 3.0 of 1 beads seen (300 %)'


def test_bright_beads_are_named_as_the_reason():
    nothing = replace(GOOD, expected=633, seen=0.0, complete=0.0)
    flag = recognition_verdict(nothing, Scenery(contrast='bright')).flags[0]
    assert 'look brighter than the floor' in flag.text
    assert '`look: bright`' in flag.remedy


def test_where_most_beads_are_seen_their_look_is_not_blamed():
    few = replace(GOOD, seen=19.0, complete=0.0)
    flag = recognition_verdict(few, Scenery(contrast='bright')).flags[0]
    assert 'brighter' not in flag.text


def test_any_number_of_beads_has_no_share():
    verdict = recognition_verdict(replace(GOOD, expected=None, seen=3.3, complete=0.0))
    assert verdict.text == 'tray 1, steel: 3.3 beads seen, mean of 300 frames'
    assert verdict.usable
    assert names(recognition_verdict(replace(GOOD, expected=None, seen=0.0))) == ['nothing_seen']


def test_grave_faults_come_first():
    verdict = recognition_verdict(replace(GOOD, seen=19.0, complete=0.0, at_rest=0.9))
    assert names(verdict) == ['never_move', 'few_seen']


def test_outlines_that_are_no_circles_are_elongated():
    assert names(recognition_verdict(GOOD, Scenery(elongated=0.9))) == ['elongated']


def test_crowded_grains_have_no_verdict():
    assert recognition_verdicts([GOOD, replace(GOOD, followed=False, seen=0.0)]) == (
        recognition_verdict(GOOD),
    )


def test_a_verdict_is_plain_json():
    values = verdict_as_json(recognition_verdict(replace(GOOD, track_length=math.nan, seen=0.0)))
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values['flags'][0]['name'] == 'nothing_seen'


def test_nothing_seen_of_beads_that_are_learnt_has_another_remedy():
    flag = recognition_verdict(replace(GOOD, seen=0.0, learnt=True)).flags[0]
    assert 'correct diameter_mm' in flag.remedy
    assert 'look: auto' not in flag.remedy


@pytest.mark.parametrize(('level', 'contrast'), [(220, 'bright'), (20, 'dark'), (110, '')])
def test_a_picture_says_whether_beads_are_bright_or_dark(level, contrast):
    picture = np.random.default_rng(1).integers(105, 115, (100, 100)).astype(np.uint8)
    picture[20:30, 20:30] = level
    assert scenery_of(picture).contrast == contrast
