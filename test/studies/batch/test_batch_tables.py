"""Tables of a batch, of values as a summary keeps them."""

from __future__ import annotations

import json

import pytest

from nanorocks_ros.outputs.tables.csv_tables import read_csv
from nanorocks_ros.outputs.tables.table_files import PACKAGE
from nanorocks_ros.studies.batch.batch_tables import write_tables
from nanorocks_ros.studies.batch.campaign_means import MEANS, Combined, CycleRow, Mean, TrayMeans

CYCLE = {
    'cycle': 1,
    'start': 2.5,
    'status': 'final',
    'relation': 'library',
    'headline': 'joint',
    'samples': 30,
    'quality': ['glare', 'few_beads'],
    'restitution': 0.875,
    'rebounds': 3,
    'collisions': 4,
    'sticking_status': None,
}


@pytest.fixture
def tables(tmp_path):
    means = {name: Mean(1.5, 0.25, 0.5, 2) for name in MEANS}
    tray = TrayMeans(tray=1, recordings=2, cycles=2, restitution=None, sticking=None, means=means)
    rows = [CycleRow('a', 1, CYCLE), CycleRow('b', 1, {**CYCLE, 'quality': []})]
    combined = Combined(trays={1: tray}, cycles=rows, campaign=None, size_unit='m', notices=[])
    write_tables(combined, tmp_path, 'csv', {'created': 'today'})
    return tmp_path


def columns(path):
    names, rows = read_csv(path)
    return dict(zip(names, zip(*rows, strict=True), strict=True))


def test_cycles_have_words_for_codes_and_empty_cells_for_what_is_not_known(tables):
    cycles = columns(tables / 'cycles.csv')
    assert cycles['recording'] == ('a', 'b')
    assert cycles['quality'] == ('glare;few_beads', 'good')
    assert cycles['status'] == ('final', 'final')
    assert cycles['sticking_status'] == ('unknown', 'unknown')
    assert cycles['restitution'] == ('0.875', '0.875')
    assert cycles['samples'] == ('30', '30')
    assert cycles['haff_time'] == ('', '')


def test_means_of_trays_are_described_with_their_units(tables):
    trays = columns(tables / 'trays.csv')
    assert trays['mean_peak_speed'] == ('1.5',)
    assert trays['speed_dependent'] == trays['friction_unknown'] == ('unknown',)
    package = json.loads((tables / PACKAGE).read_text())
    assert package['provenance'] == {'created': 'today'}
    cycles, means = (
        {field['name']: field for field in resource['schema']['fields']}
        for resource in package['resources']
    )
    assert list(means) == list(trays)
    assert cycles['cluster_size']['unit'] == means['mean_cluster_size_error']['unit'] == 'm'
    units = [means[name]['unit'] for name in ('mean_peak_speed', 'peak_speed_scatter')]
    assert units == ['m/s', 'm/s']
    assert means['haff_time_cycles']['type'] == 'integer'


def test_pandas_reads_both(tables):
    pandas = pytest.importorskip('pandas')
    cycles = pandas.read_csv(tables / 'cycles.csv')
    assert cycles['samples'].dtype.kind == 'i'
    assert cycles['haff_time'].isna().all()
    trays = pandas.read_csv(tables / 'trays.csv')
    assert trays['mean_onset'].tolist() == [1.5]
