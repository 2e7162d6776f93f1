"""The command ``nanorocks figure dust``."""

from __future__ import annotations

import json

import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.trays import load_trays


def draw(*arguments):
    return main(['figure', 'dust', *(str(argument) for argument in arguments)])


def test_the_papers_points_and_measured_ones_are_drawn_with_the_curves(tmp_path, capsys):
    output = tmp_path / 'a.svg'
    assert draw('-o', output, '--measured', '1:0.003:0.002:0.004', '--json') == 0
    values = json.loads(capsys.readouterr().out)
    assert [point['tray'] for point in values['points']] == [1, 3, 5, 1]
    measured = values['points'][-1]
    assert measured['sticking_speed'] == 0.003
    assert measured['sticking_speed_lower'] == 0.002
    assert measured['mass'] == load_trays()[1].mean_mass
    assert values['collapse_time_factor'] == pytest.approx(4.81, abs=0.01)
    assert all(not curve['verified'] for curve in values['curves'])
    assert output.stat().st_size > 10_000


def test_unverified_curves_are_marked_in_the_text(tmp_path, capsys):
    assert draw('-o', tmp_path / 'a.png') == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('tray 1: 10.4 mm/s at 4.94 mg (the paper')
    assert all('(unverified)' in line for line in lines if 'published' in line)
    assert 'takes 4.81 times as long' in lines[-1]


def test_elastic_particles_never_collapse(tmp_path, capsys):
    assert draw('-o', tmp_path / 'a.png', '--restitution', '1') == 0
    assert 'never collapses' in capsys.readouterr().out
    assert draw('-o', tmp_path / 'b.png', '--restitution', '1', '--json') == 0
    assert json.loads(capsys.readouterr().out)['collapse_time_factor'] is None


@pytest.mark.parametrize(
    ('more', 'text'),
    [
        (('--measured', '1'), 'TRAY:SPEED'),
        (('--measured', 'x:0.01'), 'cannot be read'),
        (('--measured', '1:0.01:0.02'), 'one end of an interval'),
        (('--measured', '1:0.01:0.02:0.03'), 'not within'),
        (('--measured', '1:-0.01'), 'positive'),
        (('--measured', '9:0.01'), 'tray 9'),
        (('--no-paper',), 'there are none'),
        (('--restitution', '2'), 'from 0 to 1'),
        (('--trays-file', 'nowhere.yaml'), 'nowhere.yaml'),
    ],
)
def test_a_wrong_call_is_named_in_one_line(tmp_path, monkeypatch, capsys, more, text):
    monkeypatch.chdir(tmp_path)
    assert draw('-o', 'a.png', *more) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count('\n') == 1
    assert not list(tmp_path.iterdir())
