"""The commands ``nanorocks figure decay`` and ``nanorocks figure instantaneous``."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from decays import simulated_table, write_rows
from matplotlib.colors import to_rgb
from picture_colours import colours_of

from nanorocks_ros.cli.main import main
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, PAPER


@pytest.fixture(scope='module')
def table(tmp_path_factory):
    return simulated_table(tmp_path_factory.mktemp('speeds') / 'tray_1_speed.csv', 18)


def draw(kind, table, output, *more):
    return main(['figure', kind, str(table), '-o', str(output), *more])


def bgr(colour):
    return tuple(round(255 * part) for part in to_rgb(colour))[::-1]


def colours(path):
    picture = cv2.imread(str(path))
    assert min(picture.shape[:2]) > 400
    return colours_of(picture)


def test_the_decay_is_drawn_with_both_fits(table, tmp_path, capsys):
    assert draw('decay', table, tmp_path / 'a.png', '--json') == 0
    values = json.loads(capsys.readouterr().out)
    assert values['cycles'] == 18
    assert values['confined'] == pytest.approx(0.89, abs=0.02)
    assert values['confined_error'] < 0.02
    # The closed form of the paper for a gas of restitution 0.89.
    assert 0.96 < values['paper'] < 0.99
    assert {bgr(FITTED), bgr(PAPER)} <= colours(tmp_path / 'a.png')


def test_the_restitution_is_drawn_with_the_effect_of_noise(table, tmp_path, capsys):
    assert draw('instantaneous', table, tmp_path / 'a.png', '--json') == 0
    values = json.loads(capsys.readouterr().out)
    paper = np.array(values['paper_restitution'])
    low, high = np.array(values['noise_and_gas_95'])
    assert np.mean((paper > low) & (paper < high)) > 0.85
    assert len(values['local_speed']) == 8
    assert {bgr(FITTED), bgr(MEASURED)} <= colours(tmp_path / 'a.png')


def test_a_folder_of_results_is_accepted(table, tmp_path, capsys):
    assert draw('decay', table.parent, tmp_path / 'a.pdf') == 0
    assert (tmp_path / 'a.pdf').read_bytes().startswith(b'%PDF')
    assert '18 cycles of tray 1' in capsys.readouterr().err


def test_a_single_cycle_can_be_drawn(tmp_path):
    table = simulated_table(tmp_path / 'tray_1_speed.csv', 1)
    for kind in ('decay', 'instantaneous'):
        assert draw(kind, table, tmp_path / f'{kind}.png') == 0


@pytest.mark.parametrize(
    ('more', 'code', 'text'),
    [
        (('-o', 'a.txt'), 2, 'ends in none of'),
        (('-o', 'a.png', '--first', '5', '--last', '2'), 2, 'two times, rising'),
        (('-o', 'a.png', '--tray', '3'), 2, 'is of tray 1; leave out --tray 3'),
        (('-o', 'a.png', '--wall-restitution', '1.2'), 2, 'from 0 to 1'),
        (('-o', 'a.png', '--first', '90', '--last', '99'), 1, 'in common'),
    ],
)
def test_a_wrong_call_is_named_in_one_line(table, tmp_path, monkeypatch, capsys, more, code, text):
    monkeypatch.chdir(tmp_path)
    for kind in ('instantaneous', 'decay'):
        if kind == 'decay' and '1.2' in more:
            continue
        assert main(['figure', kind, str(table), *more]) == code
        error = capsys.readouterr().err
        assert text in error
        assert error.count('\n') == 1
        assert not list(tmp_path.glob('a*'))


def test_a_picture_that_exists_is_not_overwritten(table, tmp_path, capsys):
    (tmp_path / 'a.png').write_text('mine')
    assert draw('decay', table, tmp_path / 'a.png') == 1
    assert 'add --force' in capsys.readouterr().err
    assert (tmp_path / 'a.png').read_text() == 'mine'
    assert draw('decay', table, tmp_path / 'a.png', '--force') == 0


def test_a_table_without_a_tray_number_needs_the_flag(table, tmp_path, capsys):
    unnamed = tmp_path / 'speeds.csv'
    unnamed.write_bytes(table.read_bytes())
    assert draw('decay', unnamed, tmp_path / 'a.png') == 2
    assert '--tray' in capsys.readouterr().err
    assert draw('decay', unnamed, tmp_path / 'a.png', '--tray', '1') == 0


def test_rising_speeds_are_an_error(tmp_path, capsys):
    rows = [(0.1 * k, 1, 0.0, 1e-3 + 1e-5 * k, 1e-4, 0.3) for k in range(1, 200)]
    table = write_rows(tmp_path / 'tray_1_speed.csv', rows)
    for kind in ('decay', 'instantaneous'):
        assert draw(kind, table, tmp_path / 'a.png') == 1
        assert 'do not fall' in capsys.readouterr().err


def test_a_tray_too_dense_for_the_theory_names_the_alternative(tmp_path, capsys):
    rows = [(0.1 * k, 1, 0.0, 0.01 / (1.0 + 0.05 * k), 1e-5, 0.3) for k in range(1, 220)]
    table = write_rows(tmp_path / 'tray_1_speed.csv', rows)
    trays = tmp_path / 'trays.yaml'
    trays.write_text(
        'densities_g_cm3: {acrylic: 1.18}\n'
        'trays: {1: {dimensions_mm: [15, 15, 3], '
        'species: [{material: acrylic, diameter_mm: 2, count: 60}]}}\n'
    )
    assert draw('instantaneous', table, tmp_path / 'a.png', '--trays-file', str(trays)) == 2
    assert 'use the decay library' in capsys.readouterr().err
