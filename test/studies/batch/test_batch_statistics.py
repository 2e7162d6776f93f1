"""Statistics of the gas in the recordings of a batch, and in its report."""

from __future__ import annotations

import json

import cv2
import pytest

from benchmarks.batch import short_film
from nanorocks_ros.cli.main import main


@pytest.fixture(scope='module')
def batch(tmp_path_factory):
    """Two bags, one too short for velocities, analysed with statistics."""
    folder = tmp_path_factory.mktemp('statistics')
    short_film(folder / 'bags' / 'long', 1, 5.0)
    short_film(folder / 'bags' / 'short', 2, 1.6)
    arguments = ['analyse', str(folder / 'bags'), '-o', str(folder / 'results')]
    assert main([*arguments, '--statistics', '--workers', '1']) == 0
    return folder


def test_every_recording_has_its_values_and_figures(batch):
    folder = batch / 'results' / 'bags' / 'long'
    (species,) = json.loads((folder / 'statistics.json').read_text())['1']['species']
    assert species['material'] == 'acrylic'
    for name in ('collisions', 'wall_hits'):
        assert species[f'{name}_per_path'] > 0.0
        assert species[f'theory_{name}_per_path'] > 0.0
    assert cv2.imread(str(folder / 'tray_1_statistics.png')).std() > 10.0


def test_a_recording_without_velocities_says_why(batch):
    folder = batch / 'results' / 'bags' / 'short'
    values = json.loads((folder / 'statistics.json').read_text())
    assert 'no bead moves measurably' in values['1']['reason']
    assert not (folder / 'tray_1_statistics.png').exists()


def test_the_report_has_a_table_and_a_figure_of_each_tray(batch):
    page = (batch / 'results' / 'report.html').read_text()
    assert 'The gas: velocities, collisions, pairs, structure' in page
    assert 'wall hits per mm of path' in page
    assert 'Tray 1 in long' in page
    assert 'no bead moves measurably' in page


def test_a_batch_without_statistics_is_analysed_again_for_them(batch, capsys):
    arguments = ['analyse', str(batch / 'bags' / 'short'), '-o', str(batch / 'plain')]
    assert main([*arguments, '--workers', '1']) == 0
    assert 'The gas:' not in (batch / 'plain' / 'report.html').read_text()
    assert not (batch / 'plain' / 'bags' / 'short' / 'statistics.json').exists()
    assert main([*arguments, '--workers', '1', '--statistics']) == 0
    assert (batch / 'plain' / 'bags' / 'short' / 'statistics.json').exists()
    capsys.readouterr()
