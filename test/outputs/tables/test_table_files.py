"""Tables are read by pandas, R and Excel, and say what their columns are."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import (
    PACKAGE,
    write_package,
    write_rows,
    write_table,
)

COLUMNS = (
    Column(name='time', unit='s', doc='since epoch'),
    Column(name='cycle', kind='int64', unit='1', doc='shaking events so far'),
    Column(name='status', kind='string', doc='state', words=('cooling', 'final')),
    Column(name='quality', kind='string', words=('good', 'glare', 'frozen'), several=True),
    Column(name='seen', kind='bool'),
    Column(name='size', unit='1'),
)
ROWS = [
    (1_700_000_000.123456, 1, 'cooling', 'good', True, math.nan),
    (0.1, 2, 'final', 'glare;frozen', False, math.nan),
]
DTYPES = {'time': 'f', 'cycle': 'i', 'status': 'T', 'quality': 'T', 'seen': 'b', 'size': 'f'}


def arrays():
    columns = zip(*ROWS, strict=True)
    return {column.name: np.array(values) for column, values in zip(COLUMNS, columns, strict=True)}


@pytest.mark.parametrize('form', ['csv', 'parquet'])
def test_pandas_reads_the_columns_in_their_kinds(tmp_path, form):
    pandas = pytest.importorskip('pandas')
    if form == 'parquet':
        pytest.importorskip('pyarrow')
    path = tmp_path / f'a.{form}'
    write_table(path, COLUMNS, [arrays()], {})
    frame = pandas.read_csv(path) if form == 'csv' else pandas.read_parquet(path)
    assert list(frame.columns) == [column.name for column in COLUMNS]
    assert frame['time'].tolist() == [row[0] for row in ROWS]
    kinds = {'f': 'is_float_dtype', 'i': 'is_integer_dtype', 'b': 'is_bool_dtype'}
    for name, kind in DTYPES.items():
        if kind == 'T':
            assert frame[name].astype(str).tolist() == arrays()[name].tolist()
        else:
            assert getattr(pandas.api.types, kinds[kind])(frame[name])
    assert frame['size'].isna().all()


def test_r_reads_numbers_and_truth_values_as_such(tmp_path):
    # What `type.convert`, which `read.csv` calls, takes: missing, numbers, truth values.
    write_table(tmp_path / 'a.csv', COLUMNS, [arrays()], {})
    _, *lines = (tmp_path / 'a.csv').read_text().splitlines()
    for line in lines:
        time, cycle, _, _, seen, size = line.split(',')
        assert re.fullmatch(r'-?\d+(\.\d+)?(e[-+]?\d+)?', time)
        assert re.fullmatch(r'-?\d+', cycle)
        assert seen in ('T', 'F', 'TRUE', 'FALSE', 'true', 'false', 'True', 'False')
        assert size == ''


def test_a_table_has_its_description_beside_it(tmp_path):
    write_rows(tmp_path / 'My speeds.csv', COLUMNS, ROWS, {'epoch_ns': 5, 'scale': math.nan})
    described = json.loads((tmp_path / 'My speeds.csv.json').read_text())
    assert described['path'] == 'My speeds.csv'
    assert re.fullmatch(r'[-a-z0-9._/]+', described['name'])
    assert described['provenance'] == {'epoch_ns': 5, 'scale': None}
    assert described['schema']['missingValues'] == ['']
    fields = {field['name']: field for field in described['schema']['fields']}
    assert list(fields) == (tmp_path / 'My speeds.csv').read_text().splitlines()[0].split(',')
    assert fields['time'] == {
        'name': 'time',
        'type': 'number',
        'unit': 's',
        'description': 'since epoch',
    }
    types = [fields[name]['type'] for name in ('cycle', 'status', 'seen')]
    assert types == ['integer', 'string', 'boolean']
    assert fields['status']['constraints'] == {'enum': ['cooling', 'final']}
    pattern = fields['quality']['constraints']['pattern']
    assert re.fullmatch(pattern, 'glare;frozen')
    assert not re.fullmatch(pattern, 'glare,frozen')


def test_a_folder_describes_all_its_tables(tmp_path):
    write_package(tmp_path, {'a.csv': COLUMNS, 'b.parquet': COLUMNS[:1]}, {'source': 'x'})
    package = json.loads((tmp_path / PACKAGE).read_text())
    assert [resource['path'] for resource in package['resources']] == ['a.csv', 'b.parquet']
    assert [resource['format'] for resource in package['resources']] == ['csv', 'parquet']
    assert package['provenance'] == {'source': 'x'}


def test_a_table_of_a_described_folder_has_no_description_of_its_own(tmp_path):
    write_table(tmp_path / 'a.csv', COLUMNS, [arrays()], {}, described=False)
    assert [path.name for path in tmp_path.iterdir()] == ['a.csv']
