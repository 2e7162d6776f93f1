"""Clusters at the end of a cycle, as Table 3 has them."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.csv_tables import write_csv
from nanorocks_ros.outputs.table_columns import float_columns
from nanorocks_ros.studies.reproduction.campaign_cycle import RESULTS, CycleFiles
from nanorocks_ros.studies.reproduction.chapters.cluster_chapter import tracked_end

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
