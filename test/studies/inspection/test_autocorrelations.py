"""Autocorrelations of one cycle compared with the truth, and their command and figure."""

from __future__ import annotations

import csv
import json
import math

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.physics.paper_clusters import PAPER_TABLE_3
from nanorocks_ros.records import SizeStatus
from nanorocks_ros.settings import (
    CompressionSettings,
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.studies.inspection.autocorrelations import cycle_clusters
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder

SCALE = 9600.0
ON_PLATE = {'trays': [1, 6], 'preprocess.layout': 'plate', 'preprocess.pixels_per_metre': SCALE}
FLAGS = [
    *('--trays', '1', '6', '--preprocess-layout', 'plate'),
    *('--preprocess-pixels-per-metre', str(SCALE)),
]


def silent(done, total):
    pass


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """The plate with trays 1 and 6 for two seconds; all colliding beads stick."""
    path = tmp_path_factory.mktemp('clusters') / 'bag'
    values = {
        'width_px': 1200,
        'height_px': 860,
        'first_shake': 0.4,
        'frame_rate': 10.0,
        'sticking_speed': 0.05,
        'mean_speed': 0.02,
    }
    simulation = with_values(SimulationSettings(), values, 'test')
    scene = with_values(SceneSettings(), {'trays': (1, 6), 'pixels_per_metre': SCALE}, 'test')
    recorder = SceneRecorder(simulation, scene, 2.4)
    recorder.into_bag(path, CompressionSettings(), 90, silent)
    return path


@pytest.fixture(scope='module')
def clusters(bag):
    return cycle_clusters(bag, with_values(PipelineSettings(), ON_PLATE, 'test'))


def test_the_estimates_of_the_cycle_agree_with_the_truth(clusters):
    tray = clusters.trays[1]
    assert tray.times == pytest.approx(0.2 * np.arange(tray.times.size) + tray.times[0], abs=0.11)
    assert 0.0 <= tray.times[0] < 0.3
    true = tray.true_sizes()
    assert (np.diff(true) >= 0.0).all()
    assert 1.0 <= true[0] < true[-1] <= 15.0
    assert tray.true_onset() == pytest.approx(0.1, abs=0.2)
    lower, upper = tray.column('cluster_size_lower'), tray.column('cluster_size_upper')
    inside = (lower <= true) & (true <= upper)
    assert inside.mean() > 0.5


def test_the_snapshots_are_one_of_flying_beads_and_the_last(clusters):
    tray = clusters.trays[1]
    first, last = tray.snapshots
    assert 0.5 <= first.since < 0.8
    assert last.since == pytest.approx(tray.times[-1])
    # At 9600 px/m at half the resolution.
    assert first.values.shape == (first.gray.shape[0] // 2, first.gray.shape[1] // 2)


def test_the_paper_calibration_uses_the_true_count_at_the_end(clusters):
    tray = clusters.trays[1]
    counted = tray.counted()
    assert 2.0 <= counted <= 15.0
    ends = tray.column('level_area')[tray.times >= tray.times[-1] - 2.0]
    sizes = tray.paper_sizes()[-ends.size :]
    assert sizes.mean() == pytest.approx(counted)


def test_in_a_tray_full_of_grains_there_is_an_area_but_no_size(clusters):
    tray = clusters.trays[6]
    assert {estimate.size_status for estimate in tray.estimates} == {SizeStatus.INSENSITIVE}
    assert (tray.column('level_area') > 0.0).all()


def test_the_command_writes_figure_and_table_and_prints_the_sizes(bag, tmp_path, capsys):
    picture, table = tmp_path / 'clusters.png', tmp_path / 'clusters.csv'
    arguments = ['autocorrelation', str(bag), *FLAGS, '-o', str(picture), '--table', str(table)]
    assert main([*arguments, '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['cycle'] == 1
    assert printed['trays']['6']['size_status'] == 'insensitive'
    assert printed['trays']['6']['cluster_size'] is None
    assert printed['trays']['1']['true_cluster_size'] > 1.0
    assert cv2.imread(str(picture)).shape[1] > 1000
    with table.open(newline='') as stream:
        rows = list(csv.DictReader(stream))
    assert {row['tray'] for row in rows} == {'1', '6'}
    assert len(rows) == printed['trays']['1']['pictures'] + printed['trays']['6']['pictures']
    assert float(rows[0]['level_area']) > 0.0
    assert main(arguments) == 1
    assert 'add --force' in capsys.readouterr().err


def test_cycle_0_before_the_first_shake_can_be_selected(bag):
    settings = with_values(PipelineSettings(), ON_PLATE, 'test')
    before = cycle_clusters(bag, settings, cycle=0).trays[1]
    assert math.isnan(before.true_onset())
    assert (before.true_sizes() == 1.0).all()
    assert before.times.max() < 0.5


def test_a_missing_cycle_is_reported_in_one_line(bag, capsys):
    assert main(['autocorrelation', str(bag), *FLAGS, '--cycle', '7']) == 1
    printed = capsys.readouterr().err
    assert 'holds no cycle 7; name another with --cycle: 0, 1' in printed
    assert printed.count('\n') == 1


def test_empty_trays_are_drawn(bag, tmp_path, capsys):
    # Trays 3 and 5 of this film are empty.
    flags = [*FLAGS[:1], '3', '5', *FLAGS[3:]]
    picture = tmp_path / 'empty.png'
    arguments = ['autocorrelation', str(bag), *flags, '-o', str(picture), '--json']
    assert main(arguments) == 0
    printed = json.loads(capsys.readouterr().out)['trays']
    assert [printed[tray]['size_status'] for tray in ('3', '5')] == ['nothing', 'nothing']
    assert picture.exists()


def test_without_the_truth_the_counts_of_the_paper_are_used(tmp_path):
    path = tmp_path / 'bag'
    settings = with_values(
        SimulationSettings(), {'width_px': 210, 'height_px': 210, 'first_shake': 0.3}, 'test'
    )
    film_into_bag(path, settings, duration=1.5, quality=90, progress=silent)
    tray = cycle_clusters(path, PipelineSettings()).trays[1]
    assert tray.counted() == PAPER_TABLE_3[1].beads_per_cluster
    assert np.isnan(tray.true_sizes()).all()
    assert math.isnan(tray.true_onset())
    assert math.isfinite(tray.paper_onset())
