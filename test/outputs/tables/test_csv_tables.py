"""Tables have one header row, and are there completely or not at all."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.tables.csv_tables import number, read_csv, write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns

COLUMNS = float_columns(('time', 'mean_projected_speed'), ('s', 'm/s'))


def test_the_header_is_plain_names_and_what_is_not_known_is_empty(tmp_path):
    rows = [(0.1, math.nan), (2, np.float32(0.1)), (np.float64(3.5), np.float32('nan'))]
    write_csv(tmp_path / 'speed.csv', COLUMNS, [*rows, (4, None), (5, -math.inf)])
    assert (tmp_path / 'speed.csv').read_text() == (
        'time,mean_projected_speed\n0.1,\n2,0.1\n3.5,\n4,\n5,\n'
    )


def test_truth_values_are_words_that_all_readers_know(tmp_path):
    write_csv(tmp_path / 'a.csv', COLUMNS, [(True, np.bool_(False))])
    assert (tmp_path / 'a.csv').read_text().splitlines()[1] == 'true,false'


@pytest.mark.parametrize(
    'text',
    [
        'time,speed\n0.5,\n',
        'time [s],speed [m/s]\n0.5,nan\n',
        '# time [s], speed [m/s]\ntime,speed\n0.5,\n',
        '\ufefftime,speed\r\n0.5,NaN\r\n',
    ],
    ids=['now', 'units in the header', 'a line of units', 'from a spreadsheet'],
)
def test_tables_of_every_version_are_read(tmp_path, text):
    (tmp_path / 'a.csv').write_text(text, encoding='utf-8')
    names, rows = read_csv(tmp_path / 'a.csv')
    assert names == ['time', 'speed']
    assert number(rows[0][0]) == 0.5
    assert math.isnan(number(rows[0][1]))


def test_cells_are_numbers_or_an_error():
    assert [number(cell) for cell in ('1e-3', 'true', 'FALSE')] == [0.001, 1.0, 0.0]
    with pytest.raises(ValueError, match='word'):
        number('word')


def test_numbers_come_back_exactly(tmp_path):
    rows = np.random.default_rng(0).normal(size=(20, 2))
    write_csv(tmp_path / 'speed.csv', COLUMNS, rows.tolist())
    back = np.loadtxt(tmp_path / 'speed.csv', delimiter=',', skiprows=1)
    assert np.array_equal(back, rows)


def test_a_table_of_no_rows_has_its_header(tmp_path):
    write_csv(tmp_path / 'speed.csv', COLUMNS, [])
    assert (tmp_path / 'speed.csv').read_text() == 'time,mean_projected_speed\n'


def test_an_interrupted_table_leaves_the_earlier_one_alone(tmp_path):
    write_csv(tmp_path / 'speed.csv', COLUMNS, [(1, 2)])
    before = (tmp_path / 'speed.csv').read_text()

    def rows():
        yield (3, 4)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_csv(tmp_path / 'speed.csv', COLUMNS, rows())
    assert (tmp_path / 'speed.csv').read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ['speed.csv']


def test_a_row_of_another_length_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r'row 2 has 1 values for 2 fields'):
        write_csv(tmp_path / 'speed.csv', COLUMNS, [(1, 2), (3,)])
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(
        RecordingError, match=r'cannot be written \(.*\); make room, or write elsewhere$'
    ):
        write_csv(tmp_path / 'file' / 'speed.csv', COLUMNS, [])
    with pytest.raises(RecordingError, match=r'cannot be written \(No such file'):
        write_csv(tmp_path / 'nowhere' / 'speed.csv', COLUMNS, [])
