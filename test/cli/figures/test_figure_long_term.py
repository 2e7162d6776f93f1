"""The command ``nanorocks figure long-term``."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from campaigns import SIZE, write_recording

from nanorocks_ros.cli.main import main


def draw(*arguments):
    return main(['figure', 'long-term', *(str(argument) for argument in arguments)])


@pytest.fixture(scope='module')
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp('campaign')
    sizes = SIZE * (1.0 + 0.05 * np.random.default_rng(4).normal(size=30))
    sizes[18:24] *= 1.4
    return [
        write_recording(root / f'r{k}', (1, 3), 15, sizes[15 * k : 15 * (k + 1)]) for k in range(2)
    ]


def test_a_campaign_is_drawn_and_written_as_a_table(folders, tmp_path, capsys):
    picture, table = tmp_path / 'a.png', tmp_path / 'a.csv'
    assert draw(*folders, '-o', picture, '--table', table, '--json') == 0
    values = json.loads(capsys.readouterr().out)
    assert values['cycles'] == 30
    (period,) = values['quiet_periods']
    assert (period['first'], period['last']) == (19, 24)
    assert len(values['trays']['3']['restitution']) == 30
    assert values['trays']['1']['trends']['peak_speed']['cycles'] == 30
    assert min(cv2.imread(str(picture)).shape[:2]) > 600
    assert len(table.read_text().splitlines()) == 61


def test_trends_and_quiet_periods_are_printed(folders, tmp_path, capsys):
    assert draw(*folders, '-o', tmp_path / 'a.png') == 0
    text = capsys.readouterr()
    assert 'tray 1, peak speed: ' in text.out
    assert 'mm/s a cycle, 30 cycles' in text.out
    assert 'quiet period: cycles 19 to 24, clusters larger by' in text.out
    assert '30 cycles in' in text.err


def test_a_single_cycle_has_no_trend_but_a_picture(tmp_path, capsys):
    folder = write_recording(tmp_path / 'r', (1,), 1, [SIZE])
    assert draw(folder, '-o', tmp_path / 'a.png') == 0
    out = capsys.readouterr().out
    assert 'tray 1, restitution: no trend from 1 cycles' in out
    assert 'no quiet period' in out


def test_missing_restitutions_are_reported_as_unknown(tmp_path, capsys):
    folder = write_recording(tmp_path / 'r', (1,), 6, np.full(6, SIZE))
    (folder / 'tray_1_cor.csv').unlink()
    assert draw(folder, '-o', tmp_path / 'a.svg') == 0
    assert 'tray 1, restitution: not known' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('more', 'code', 'text'),
    [
        (('-o', 'a.txt'), 2, 'ends in none of'),
        (('-o', 'a.png', '--table', 'a.txt'), 2, '--table'),
        (('-o', 'a.png', '--false-alarms', '0'), 2, 'false alarms'),
        (('nowhere', '-o', 'a.png'), 1, 'nowhere: is no folder'),
    ],
)
def test_a_wrong_call_is_named_in_one_line(
    folders, tmp_path, monkeypatch, capsys, more, code, text
):
    monkeypatch.chdir(tmp_path)
    assert draw(folders[0], *more) == code
    error = capsys.readouterr().err
    assert text in error
    assert error.count('\n') == 1
    assert not list(tmp_path.iterdir())
