"""The command that measures the gas of a bag."""

from __future__ import annotations

import json

import pytest

import nanorocks_ros as nr
from nanorocks_ros.cli.main import main
from nanorocks_ros.outputs.tables.table_files import PACKAGE
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.gas_statistics.statistics_files import TABLES
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('statistics') / 'bag'
    settings = SimulationSettings(width_px=210, height_px=210, first_shake=0.4)
    film_into_bag(path, settings, duration=6.0, quality=90, progress=lambda done, total: None)
    return path


def test_the_command_prints_and_writes(bag, tmp_path, capsys):
    folder = tmp_path / 'gas'
    assert main(['statistics', str(bag), '-o', str(folder), '--to', '5']) == 0
    printed = capsys.readouterr()
    assert 'acrylic: a2 ' in printed.out
    assert 'mean free path' in printed.out
    assert str(folder) in printed.err
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [*TABLES, 'tray_1.png', PACKAGE]
    )
    read = nr.read(folder)
    assert {f'{name}.csv' for name in read.tables} == set(TABLES)
    assert read.table('energies')['species'].eq('acrylic').all()


def test_json_is_one_object_with_errors(bag, capsys):
    assert main(['statistics', str(bag), '--json']) == 0
    values = json.loads(capsys.readouterr().out)
    species = values['trays']['1']['species'][0]
    assert values['frames'] == 180
    assert species['material'] == 'acrylic'
    assert species['fourth_cumulant_error'] > 0.0
    assert 0.0005 < species['mean_free_path'] < 0.01


def test_an_existing_folder_and_late_starts_are_refused(bag, tmp_path, capsys):
    assert main(['statistics', str(bag), '-o', str(tmp_path)]) == 1
    assert 'exists already' in capsys.readouterr().err
    assert main(['statistics', str(bag), '--from', '50']) == 1
    assert 'no bead moves' in capsys.readouterr().err
    assert main(['statistics', str(bag), '--from', '5', '--to', '4']) == 2
