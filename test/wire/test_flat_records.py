"""Elements of arrays are the values, tuples and arrays of records, by name."""

from __future__ import annotations

import math

import numpy as np

from nanorocks_ros.records import (
    CorEstimate,
    CorRelation,
    CorStatus,
    Interval,
    Measured,
    MeasuredInterval,
    Merge,
)
from nanorocks_ros.wire.flat_records import flat_names, flat_value, nested_fields

COR = CorEstimate(
    stamp_ns=0,
    tray=3,
    cycle=1,
    status=CorStatus.FINAL,
    relation=CorRelation.LIBRARY,
    restitution=Interval(0.9, 0.88, 0.92),
    haff_time=Measured(2.5, 0.25),
    species_haff_times=(Measured(2.0, 0.5),),
)


def test_values_are_flat_under_the_names_of_the_message():
    assert flat_value(COR, 'restitution') == 0.9
    assert flat_value(COR, 'restitution_lower') == 0.88
    assert flat_value(COR, 'restitution_upper') == 0.92
    assert flat_value(COR, 'haff_time_error') == 0.25
    assert flat_value(COR, 'status') is CorStatus.FINAL


def test_a_species_without_a_value_is_nan():
    assert flat_value(COR, 'first_species_haff_time') == 2.0
    assert flat_value(COR, 'first_species_haff_time_error') == 0.5
    assert math.isnan(flat_value(COR, 'second_species_haff_time'))
    assert math.isnan(flat_value(COR, 'first_species_initial_speed'))


def test_the_beads_of_a_merge_are_an_array():
    tracks = np.array([3, 11], dtype=np.int32)
    merge = Merge(stamp_ns=0, known_ns=0, tray=1, cycle=1, tracks=tracks, joins=True)
    assert (flat_value(merge, 'track_1'), flat_value(merge, 'track_2')) == (3, 11)
    nested = nested_fields(Merge, {'track_1': 3.0, 'track_2': 11.0, 'joins': 1.0})
    assert nested['tracks'].tolist() == [3, 11]
    assert nested['tracks'].dtype == np.int32


def test_species_that_are_not_known_are_left_out_only_at_the_end():
    names = (
        f'{ordinal}_species_{value}{error}'
        for ordinal in ('first', 'second')
        for value in ('initial_speed', 'haff_time')
        for error in ('', '_error')
    )
    numbers = dict.fromkeys((*flat_names(CorEstimate), *names), math.nan)
    for value in ('initial_speed', 'haff_time', 'mean_restitution', 'mean_wall_restitution'):
        numbers |= {value: 1.0, f'{value}_error': 0.1}
    for value in ('restitution', 'wall_restitution'):
        numbers |= {value: 0.9, f'{value}_lower': 0.8, f'{value}_upper': 1.0}
    numbers['second_species_haff_time'] = 2.0
    nested = nested_fields(CorEstimate, numbers)
    assert nested['species_initial_speeds'] == ()
    first, second = nested['species_haff_times']
    assert math.isnan(first.value)
    assert second.value == 2.0
    assert nested['restitution'] == Interval(0.9, 0.8, 1.0)


def test_a_value_is_known_when_it_has_an_error():
    assert Measured(1.0, 0.1).known
    assert not Measured(1.0).known
    assert math.isnan(MeasuredInterval(value=1.0).upper)
