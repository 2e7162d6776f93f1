"""``nr.read`` of tables: kinds, units, provenance, and what is no result."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import nanorocks_ros as nr
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import PACKAGE, write_package, write_table
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

COLUMNS = (
    Column(name='time', unit='s'),
    Column(name='bead', kind='int64', unit='1'),
    Column(name='partner', kind='int64', unit='1'),
    Column(name='wall', kind='string'),
    Column(name='seen', kind='bool'),
)
VALUES = {
    'time': np.array([0.1, np.nan]),
    'bead': np.array([3, 1]),
    'partner': np.array([7, None]),
    'wall': np.array([None, 'left']),
    'seen': np.array([True, False]),
}
RUN = {'created': 'today', 'command': 'nanorocks track', 'versions': {'nanorocks_ros': '0.0.9'}}


def test_a_table_comes_back_with_kinds_units_and_what_made_it(tmp_path):
    path = tmp_path / 'contacts.csv'
    write_table(path, COLUMNS, [VALUES], RUN)
    result = nr.read(path)
    assert result.tables == ('contacts',)
    frame = result.table('contacts')
    assert frame['time'].tolist()[0] == 0.1
    assert np.isnan(frame['time'].tolist()[1])
    assert frame.dtypes.astype(str).to_dict() == {
        'time': 'float64',
        'bead': 'int64',
        'partner': 'Int64',
        'wall': 'object',
        'seen': 'bool',
    }
    assert frame['partner'].isna().tolist() == [False, True]
    assert frame['wall'].isna().tolist() == [True, False]
    assert frame.attrs['units'] == {column.name: column.unit for column in COLUMNS}
    assert result.provenance['nanorocks_ros'] == '0.0.9'
    assert frame.attrs['provenance']['command'] == 'nanorocks track'
    json.dumps(frame.attrs)
    assert 'contacts' in repr(result)
    with pytest.raises(nr.ConfigurationError, match=r'table\(.contacts.\).plot'):
        result.plot()


def test_parquet_says_the_same(tmp_path):
    pytest.importorskip('pyarrow')
    known = {name: values for name, values in VALUES.items() if name not in ('partner', 'wall')}
    columns = [column for column in COLUMNS if column.name in known]
    for ending in ('csv', 'parquet'):
        write_table(tmp_path / f'a.{ending}', columns, [known], RUN)
    csv, parquet = (nr.read(tmp_path / f'a.{ending}').table('a') for ending in ('csv', 'parquet'))
    pd.testing.assert_frame_equal(csv, parquet)
    assert csv.attrs['units'] == parquet.attrs['units']
    assert parquet.attrs['provenance']['versions'] == RUN['versions']


def test_a_folder_of_described_tables_is_all_of_them(tmp_path):
    for name in ('energies', 'pairs'):
        write_table(tmp_path / f'{name}.csv', COLUMNS, [VALUES], {}, described=False)
    write_package(tmp_path, {'energies.csv': COLUMNS, 'pairs.csv': COLUMNS}, RUN)
    result = nr.read(tmp_path)
    assert result.tables == ('energies', 'pairs')
    assert result.table('pairs').attrs['units']['time'] == 's'
    assert result.provenance['created'] == 'today'


def test_a_description_names_no_file_elsewhere(tmp_path):
    write_table(tmp_path / 'own.csv', COLUMNS, [VALUES], RUN)
    (tmp_path / 'in').mkdir()
    resources = [{'path': '../own.csv'}, {'path': str(tmp_path / 'own.csv')}]
    (tmp_path / 'in' / PACKAGE).write_text(json.dumps({'resources': resources}))
    with pytest.raises(nr.RecordingError, match='holds no results'):
        nr.read(tmp_path / 'in')


def test_a_table_of_somebody_else_is_read_without_units(tmp_path):
    path = tmp_path / 'mine.csv'
    path.write_text('a,b\n1,x\n')
    frame = nr.read(path).table('mine')
    assert frame['a'].tolist() == [1]
    assert frame.attrs['units'] == {}


@pytest.mark.parametrize(
    'description', ['{', '[]', '{"schema": {"fields": [{"name": "a", "type": "odd"}]}}']
)
def test_a_damaged_description_is_one_error(tmp_path, description):
    path = tmp_path / 'a.csv'
    path.write_text('a\n1\n')
    (tmp_path / 'a.csv.json').write_text(description)
    with pytest.raises(nr.RecordingError, match=r'a\.csv'):
        nr.read(path).table('a')


def test_a_sweep_is_one_table_of_curves(tmp_path):
    plan = sweep_plan(SimulationSettings(seed=7), {'restitution': (0.8, 0.9)}, (0.0, 0.5), 1)
    path = tmp_path / 'out.npz'
    done = sweep(plan, path, Workers(processes=1))
    frame = nr.read(path).table('curves')
    assert frame['restitution'].tolist() == [0.8, 0.8, 0.9, 0.9]
    assert np.array_equal(frame['mean_speed'], done.mean_speed.ravel())
    assert frame.attrs['units']['mean_speed'] == 'm/s'


def test_what_is_no_result_says_what_to_do(tmp_path):
    with pytest.raises(nr.RecordingError, match='does not exist; name what a command wrote'):
        nr.read(tmp_path / 'none')
    (tmp_path / 'results').mkdir()
    with pytest.raises(nr.RecordingError, match=r'does not exist; did you mean .*results\?'):
        nr.read(tmp_path / 'result')
    (tmp_path / 'notes.txt').touch()
    with pytest.raises(nr.RecordingError, match='no folder and no table'):
        nr.read(tmp_path / 'notes.txt')
    (tmp_path / 'metadata.yaml').write_text('rosbag2_bagfile_information: {}\n')
    with pytest.raises(nr.RecordingError, match=r'is a recording.*nr\.analyse'):
        nr.read(tmp_path)
