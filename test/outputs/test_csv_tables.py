"""Tables say what their columns are, and are there completely or not at all."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.csv_tables import write_csv

FIELDS = ('time', 'mean_projected_speed')
UNITS = ('s', 'm/s')


def test_the_header_names_fields_and_units(tmp_path):
    write_csv(tmp_path / 'speed.csv', FIELDS, UNITS, [(0.1, math.nan), (2, np.float32(0.1))])
    assert (tmp_path / 'speed.csv').read_text() == (
        'time [s],mean_projected_speed [m/s]\n0.1,nan\n2,0.1\n'
    )


def test_numbers_come_back_exactly(tmp_path):
    rows = np.random.default_rng(0).normal(size=(20, 2))
    write_csv(tmp_path / 'speed.csv', FIELDS, UNITS, rows.tolist())
    back = np.loadtxt(tmp_path / 'speed.csv', delimiter=',', skiprows=1)
    assert np.array_equal(back, rows)


def test_a_table_of_no_rows_has_its_header(tmp_path):
    write_csv(tmp_path / 'speed.csv', FIELDS, UNITS, [])
    assert (tmp_path / 'speed.csv').read_text() == 'time [s],mean_projected_speed [m/s]\n'


def test_an_interrupted_table_leaves_the_earlier_one_alone(tmp_path):
    write_csv(tmp_path / 'speed.csv', FIELDS, UNITS, [(1, 2)])
    before = (tmp_path / 'speed.csv').read_text()

    def rows():
        yield (3, 4)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_csv(tmp_path / 'speed.csv', FIELDS, UNITS, rows())
    assert (tmp_path / 'speed.csv').read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ['speed.csv']


def test_a_row_of_another_length_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r'row 2 has 1 values for 2 fields'):
        write_csv(tmp_path / 'speed.csv', FIELDS, UNITS, [(1, 2), (3,)])
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(
        RecordingError, match=r'cannot be written \(.*\); make room, or write elsewhere$'
    ):
        write_csv(tmp_path / 'file' / 'speed.csv', FIELDS, UNITS, [])
    with pytest.raises(RecordingError, match=r'cannot be written \(No such file'):
        write_csv(tmp_path / 'nowhere' / 'speed.csv', FIELDS, UNITS, [])
