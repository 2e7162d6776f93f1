"""Clusters at the end of a cycle, as Table 3 has them."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.html_report import NOT_KNOWN
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.studies.reproduction.campaign_cycle import RESULTS, CycleFiles
from nanorocks_ros.studies.reproduction.chapters.cluster_chapter import (
    ClusterEnd,
    table_3_cells,
    tracked_end,
)

TRAY = load_trays()[2]
COLUMNS = 'time', 'clusters', 'clustered_share', 'weighted_size'
ERRORS = 'clusters_error', 'clustered_share_error'


def cycle_with(folder, last):
    """A cycle of 33.8 s whose last count of bodies is at some time."""
    results = folder / RESULTS
    results.mkdir()
    names = (*COLUMNS, *ERRORS)
    row = (last, 2.0, 0.8, 22.0, 0.1, 0.01)
    units = ('s', *['1'] * (len(names) - 1))
    write_csv(results / f'tray_{TRAY.number}_bodies.csv', float_columns(names, units), [row])
    truth = {str(TRAY.number): {'time': [0.0, 33.8]}}
    return CycleFiles(folder=folder, kind='sticking', summary={'truth': truth})


def test_the_last_count_is_that_of_the_end(tmp_path):
    end = tracked_end(cycle_with(tmp_path, 33.83), TRAY)
    assert end.clusters == 2.0
    assert end.beads_per_cluster == pytest.approx(0.4 * TRAY.count)


def test_a_count_before_tracks_were_lost_is_not(tmp_path):
    end = tracked_end(cycle_with(tmp_path, 1.0), TRAY)
    assert math.isnan(end.clusters)
    assert math.isnan(end.share)


@pytest.mark.parametrize(('counted', 'is_told'), [(1, False), (4, False), (5, True), (9, True)])
def test_a_tray_is_counted_if_half_of_its_cycles_are(counted, is_told):
    known, unknown = ClusterEnd(9.0, 2.4, 0.28, 2.0, 0.2, 0.01), ClusterEnd(*4 * (math.nan,))
    cells = table_3_cells([known] * counted + [unknown] * (9 - counted))
    assert all((cell != NOT_KNOWN) is is_told for cell in cells)
