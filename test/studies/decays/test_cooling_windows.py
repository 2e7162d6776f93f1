"""The cooling window of an analysis, read from its tables."""

from __future__ import annotations

import pytest

from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.studies.decays.cooling_windows import CoolingWindow, cooling_window

FIELDS = ('status', 'window_start', 'window_end', 'cooling_start')
FINAL, COOLING, NO_DECAY = 2, 1, 3


def write(folder, rows, fields=FIELDS):
    write_csv(folder / 'tray_3_cor.csv', float_columns(fields, ['s'] * len(fields)), rows)
    return folder / 'tray_3_speed.csv'


def test_it_is_the_median_over_the_final_estimates(tmp_path):
    rows = [
        (COOLING, 1.0, 2.0, 0.0),
        (FINAL, 4.0, 20.0, 2.25),
        (FINAL, 5.0, 21.0, 3.25),
        (FINAL, 4.5, 9.0, 2.75),
        (NO_DECAY, 9.0, 9.9, 7.0),
    ]
    window = cooling_window(write(tmp_path, rows))
    assert window == CoolingWindow(first=4.5, last=20.0, start=2.75)


@pytest.mark.parametrize(
    'rows',
    [[(COOLING, 1.0, 2.0, 0.0)], [], [(FINAL, float('nan'), 2.0, 0.0)]],
)
def test_without_a_final_estimate_there_is_none(tmp_path, rows):
    assert cooling_window(write(tmp_path, rows)) is None


def test_results_of_an_earlier_release_or_none_at_all_have_none(tmp_path):
    assert cooling_window(tmp_path / 'tray_3_speed.csv') is None
    assert cooling_window(tmp_path / 'my_own_table.csv') is None
    assert cooling_window(write(tmp_path, [(FINAL, 1.0)], FIELDS[:2])) is None
