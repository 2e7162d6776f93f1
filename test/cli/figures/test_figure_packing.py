"""The command ``nanorocks figure packing``."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from cluster_tables import write_results

from nanorocks_ros.cli.main import main


def draw(*arguments):
    return main(['figure', 'packing', *(str(argument) for argument in arguments)])


@pytest.fixture
def results(tmp_path):
    areas = 1e-6 * np.concatenate(([0.5, 0.5], np.full(20, 1.1), np.full(38, 1.0)))
    return write_results(tmp_path / 'results', areas)


def test_simulated_clusters_are_compared_with_the_truth(tmp_path, capsys):
    flags = '--simulate', '--trays', '1', '--cycles', '1', '--sticking-speed', '0.01'
    assert draw(*flags, '-o', tmp_path / 'a.png', '--json') == 0
    values = json.loads(capsys.readouterr().out)
    tray = values['trays']['1']
    assert tray['paper_filling'] == pytest.approx(2 * tray['layer_filling'])
    assert tray['filling_in_space'] < tray['layer_filling'] < 0.6046
    assert tray['true_compaction'] < 0.02 < tray['apparent_compaction']
    assert tray['paper_compaction'] == 0.066
    assert min(cv2.imread(str(tmp_path / 'a.png')).shape[:2]) > 400


def test_measured_level_areas_give_the_compaction_of_the_paper(results, tmp_path, capsys):
    assert draw(results, '-o', tmp_path / 'a.png') == 0
    text = capsys.readouterr()
    assert "tray 1, 2 cycles: compaction by the paper's rule 10.0 %" in text.out
    assert '1 tray in' in text.err


@pytest.mark.parametrize(
    ('more', 'code', 'text'),
    [
        ((), 2, 'neither is given'),
        (('nowhere', '--simulate'), 2, 'both are given'),
        (('nowhere',), 1, 'is no folder'),
        (('--simulate', '--trays', '1,x'), 2, "'x' is no number of a tray"),
        (('--simulate', '--trays', '12'), 2, 'tray 12'),
        (('--simulate', '--cycles', '0'), 1, '1 or more'),
        (('--simulate', '--sticking-speed', '-1'), 2, 'sticking_speed'),
        (('.',), 1, 'holds no tray_K_cluster.csv'),
    ],
)
def test_a_wrong_call_is_named_in_one_line(tmp_path, monkeypatch, capsys, more, code, text):
    monkeypatch.chdir(tmp_path)
    assert draw(*more, '-o', 'a.png') == code
    error = capsys.readouterr().err
    assert text in error
    assert error.count('\n') == 1
    assert not list(tmp_path.glob('*.png'))


def test_a_table_without_a_column_is_named(results, tmp_path, capsys):
    (results / 'tray_1_cluster.csv').write_text('time [s],cycle [1]\n1,2\n')
    assert draw(results, '-o', tmp_path / 'a.png') == 1
    assert 'no column level_area' in capsys.readouterr().err
