"""The register of columns, against the records and the layouts of their arrays."""

from __future__ import annotations

import re

import numpy as np
import pytest

from nanorocks_ros.records import (
    CorEstimate,
    CorRelation,
    CorStatus,
    Headline,
    Interval,
    Measured,
    Merge,
    Quality,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.studies.results.record_columns import (
    GOOD,
    code_of,
    columns_of,
    record_arrays,
    word_of,
)
from nanorocks_ros.wire.array_layouts import ENUMERATIONS, layout
from nanorocks_ros.wire.products import PRODUCTS

RECORDS = [product.record for product in PRODUCTS]
# Seconds since 1970 with nanoseconds: more than float32 or its sums can hold.
EPOCH_NS = 1_700_000_000_123_456_789


def speed(stamp_ns=EPOCH_NS + 3_600_000_000_001, **values):
    return SpeedEstimate(
        **{
            'stamp_ns': stamp_ns,
            'tray': 1,
            'cycle': 2,
            'cycle_start_ns': None,
            'mean_projected_speed': Measured(0.1, 0.01),
            'window': 0.5,
            'method': SpeedMethod.TRACKING,
            **values,
        }
    )


@pytest.mark.parametrize('record', RECORDS)
def test_columns_are_the_fields_of_the_array_with_plain_names(record):
    columns = columns_of(record)
    assert [column.name for column in columns] == [field.name for field in layout(record).fields]
    assert all(re.fullmatch(r'[a-z][a-z0-9_]*', column.name) for column in columns)
    assert all(column.doc for column in columns)
    assert all((column.unit == '') == (column.kind in ('string', 'bool')) for column in columns)


@pytest.mark.parametrize('record', RECORDS)
def test_every_code_is_a_column_of_words(record):
    words = {column.name for column in columns_of(record) if column.kind == 'string'}
    assert words == {field.name for field in layout(record).fields} & set(ENUMERATIONS)


def test_times_are_exact_and_codes_are_words():
    flags = Quality.FEW_BEADS | Quality.GLARE
    rows = record_arrays(SpeedEstimate, [speed(), speed(quality=flags)], EPOCH_NS)
    assert rows['time'].dtype == np.float64
    assert rows['time'].tolist() == [3600.000000001] * 2
    assert np.isnan(rows['cycle_start']).all()
    assert rows['cycle'].dtype == np.int64
    assert rows['method'].tolist() == ['tracking'] * 2
    assert rows['quality'].tolist() == [GOOD, 'few_beads;glare']
    assert rows['mean_projected_speed'].tolist() == [0.1, 0.1]
    assert np.isnan(rows['first_species_speed']).all()


def test_a_restitution_has_its_state_in_words():
    cor = CorEstimate(
        stamp_ns=EPOCH_NS,
        tray=1,
        cycle=1,
        status=CorStatus.NO_DECAY,
        relation=CorRelation.LIBRARY,
        restitution=Interval(0.8, 0.7, 0.9),
        headline=Headline.JOINT,
    )
    rows = record_arrays(CorEstimate, [cor], EPOCH_NS)
    words = {name: rows[name][0] for name in ('status', 'relation', 'headline')}
    assert words == {'status': 'no_decay', 'relation': 'library', 'headline': 'joint'}
    assert rows['restitution_upper'].tolist() == [0.9]
    assert rows['samples'].dtype == np.int64


def test_whether_beads_join_is_a_truth_value():
    merge = Merge(
        stamp_ns=0, known_ns=5, tray=1, cycle=1, tracks=np.array([3, 4], np.int32), joins=False
    )
    rows = record_arrays(Merge, [merge], 0)
    assert rows['joins'].dtype == np.bool_
    assert rows['track_2'].tolist() == [4]
    assert rows['known'].tolist() == [5e-9]


def test_no_records_are_empty_columns_of_the_same_kinds():
    full, empty = (record_arrays(SpeedEstimate, rows, 0) for rows in ([speed()], []))
    assert list(full) == list(empty)
    assert {name: array.dtype.kind for name, array in full.items()} == {
        name: array.dtype.kind for name, array in empty.items()
    }


@pytest.mark.parametrize('name', ENUMERATIONS)
def test_every_word_gives_its_number_back(name):
    for member in ENUMERATIONS[name]:
        assert code_of(name, word_of(member)) == int(member)


def test_flags_give_their_sum_back():
    for flags in (Quality(0), Quality.SATURATED | Quality.STICKING | Quality.GLARE):
        assert code_of('quality', word_of(flags)) == int(flags)


@pytest.mark.parametrize(('name', 'word'), [('status', 'finall'), ('time', 'final')])
def test_an_unknown_word_is_refused(name, word):
    with pytest.raises(ValueError, match=r'is no (word of CorStatus|column of words)'):
        code_of(name, word)
