"""The command ``nanorocks figure impacts``."""

from __future__ import annotations

import json

import pytest
from contact_results import contact_results

from nanorocks_ros.cli.main import main


def falling(speed):
    return 1.0 - 0.2 * (speed / 3e-3) ** 0.5


@pytest.fixture
def results(tmp_path):
    return contact_results(tmp_path / 'results', falling)


def test_the_figure_is_written_and_its_numbers_are_printed(results, tmp_path, capsys):
    path = tmp_path / 'impacts.png'
    assert main(['figure', 'impacts', str(results), '-o', str(path), '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['tray'] == 1
    assert printed['beads']['law']['exponent']['value'] == pytest.approx(0.5, abs=0.3)
    assert path.stat().st_size > 10_000
    assert main(['figure', 'impacts', str(results), '-o', str(path), '--force']) == 0
    text = capsys.readouterr().out
    assert text.startswith('beads: constant 0.')
    assert 'exponent of 1 - restitution 0.' in text


def test_recordings_of_a_batch_are_taken_together(tmp_path, capsys):
    for number in (1, 2):
        contact_results(tmp_path / 'batch' / 'bags' / f'bag_{number}', falling, seed=number)
    path = tmp_path / 'impacts.svg'
    arguments = ['figure', 'impacts', str(tmp_path / 'batch'), '-o', str(path), '--json']
    assert main(arguments) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['cycles'] == 2
    assert sum(each['contacts'] for each in printed['walls']['ranges']) == 300


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (('-o', 'a.txt'), 2, 'ends in none of .png'),
        (('-o', 'a.png', '--tray', '3'), 2, '--tray: 3 is not among them: the results hold'),
        (('-o', 'a.png', '--parameters', 'no.yaml'), 2, 'no.yaml'),
    ],
)
def test_a_wrong_call_is_one_line(results, monkeypatch, capsys, arguments, code, message):
    monkeypatch.chdir(results.parent)
    assert main(['figure', 'impacts', 'results', *arguments]) == code
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1
    assert not list(results.parent.glob('a.*'))


def test_a_folder_without_results_is_refused(tmp_path, capsys):
    assert main(['figure', 'impacts', str(tmp_path), '-o', str(tmp_path / 'a.png')]) == 1
    assert 'holds no tray_K_cor.csv' in capsys.readouterr().err
