"""The command ``nanorocks figure cor``: figures 7, 12 and 13 of one tray."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sysconfig
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from decays import simulated_mixture, simulated_table, write_rows
from picture_colours import colours_of

from nanorocks_ros.cli.main import main
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns

SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'
FIGURES = ('decay.png', 'walls.png', 'width.png', 'cor_against_speed.png')
SMALL = (
    '--beads', '0.7:0.98:8', '--walls', '0.9,0.95,0.99', '--widths', '0,0.04',
    '--runs', '8', '--workers', '1',
)  # fmt: skip


@pytest.fixture(scope='module')
def table(tmp_path_factory):
    return simulated_table(tmp_path_factory.mktemp('speeds') / 'tray_1_speed.csv', 18)


@pytest.fixture(scope='module')
def mixture(tmp_path_factory):
    return simulated_mixture(tmp_path_factory.mktemp('speeds') / 'tray_5_speed.csv', 5, 6)


def draw(source, folder, *more):
    return main(['figure', 'cor', str(source), '-o', str(folder), *SMALL, *more])


@pytest.fixture(scope='module')
def folder(table, tmp_path_factory):
    """All figures, drawn once."""
    figures = tmp_path_factory.mktemp('drawn') / 'new' / 'figures'
    assert draw(table, figures) == 0
    return figures


def colours(path):
    picture = cv2.imread(str(path))
    assert min(picture.shape[:2]) > 400
    return colours_of(picture)


def test_all_figures_are_drawn_and_their_values_printed(table, folder, capsys):
    for name in FIGURES:
        (folder / name).unlink()
    searches = {path: path.stat().st_mtime_ns for path in folder.glob('*.npz')}
    assert len(searches) == 2
    assert draw(table, folder, '--json') == 0
    # The figures are drawn again from the finished search.
    assert {path: path.stat().st_mtime_ns for path in folder.glob('*.npz')} == searches
    printed, error = capsys.readouterr()
    values = json.loads(printed)
    assert (values['tray'], values['cycles']) == (1, 18)
    assert (values['first'], values['last']) == (1.75, 20.0)
    for name in FIGURES:
        assert len(colours(folder / name)) > 20
    # The minimum is at the truth, 0.89 and 0.99; chi square rises on both sides.
    walls = values['walls']
    across = np.array(walls['chi_square'])[:, walls['wall_restitution'].index(0.99)]
    beads = np.array(walls['restitution'])
    assert abs(beads[across.argmin()] - 0.89) < 0.06
    assert across[0] > 4.0 * across.min()
    assert across[-1] > 4.0 * across.min()
    # With more dissipative walls the minimum moves to less dissipative beads.
    more_dissipative = np.array(walls['chi_square'])[:, walls['wall_restitution'].index(0.95)]
    assert beads[more_dissipative.argmin()] >= beads[across.argmin()]
    assert abs(values['width']['best']['restitution'] - 0.89) < 0.06
    library = values['decay']['library']
    assert library['restitution_lower'] < 0.89 < library['restitution_upper']
    assert library['wall_restitution_lower'] < 0.99 < library['wall_restitution_upper'] + 0.01
    assert len(values['instantaneous']['local_speed']) == 8
    assert 'best at' in error


def test_a_search_of_other_values_in_the_same_folder_is_rejected(table, folder, capsys):
    assert draw(table, folder, '--walls', '0.9,0.99') == 1
    error = capsys.readouterr().err
    assert 'holds another sweep' in error
    assert 'pass another --output' in error


def test_ctrl_c_keeps_figures_and_finished_runs(table, tmp_path):
    folder = tmp_path / 'figures'
    command = Path(sysconfig.get_path('scripts')) / 'nanorocks'
    arguments = ['figure', 'cor', str(table), '-o', str(folder), *SMALL, '--runs', '4000']
    process = subprocess.Popen(
        [command, *arguments], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    parts = folder / 'walls_4000_runs.npz.parts'
    deadline = time.monotonic() + 120.0
    while len(list(parts.glob('[0-9]*.npz'))) < 2:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    error = process.communicate(timeout=60.0)[1]
    assert process.returncode == 130
    assert 'interrupted; ' in error
    assert 'the same command goes on from there' in error
    assert 'Traceback' not in error
    # Finished figures and finished parts of the search remain.
    assert (folder / 'decay.png').is_file()
    assert len(list(parts.glob('[0-9]*.npz'))) >= 2


def test_a_mixture_shows_each_species_in_its_colour(mixture, tmp_path, capsys):
    output = tmp_path / 'decay.png'
    assert main(['figure', 'decay', str(mixture), '-o', str(output), '--json']) == 0
    values = json.loads(capsys.readouterr().out)
    glass, copper = values['species']
    assert (glass['material'], copper['material']) == ('glass', 'copper')
    for species in (glass, copper):
        assert 0.0 < species['initial_speed_error'] < 0.2 * species['initial_speed']
        assert 0.0 < species['haff_time_error'] < 0.3 * species['haff_time']
    # Light beads are faster, but slower than in equipartition.
    assert glass['initial_speed'] > 1.3 * copper['initial_speed']
    assert values['energy_ratio'] + 3.0 * values['energy_ratio_error'] < 1.0
    # Lines of both, in blue, green, red.
    assert {(0xB2, 0x72, 0x00), (0x00, 0x5E, 0xD5)} <= colours(output)


def test_a_tray_of_one_species_has_no_second_panel(table, tmp_path, capsys):
    assert main(['figure', 'decay', str(table), '-o', str(tmp_path / 'a.png'), '--json']) == 0
    assert json.loads(capsys.readouterr().out)['species'] is None
    assert cv2.imread(str(tmp_path / 'a.png')).shape[0] < 1000


def test_the_window_is_that_of_the_analysis(table, tmp_path, capsys):
    speeds = tmp_path / 'tray_1_speed.csv'
    speeds.write_bytes(table.read_bytes())
    fields = ('status', 'window_start', 'window_end', 'cooling_start')
    # The third is a live estimate.
    rows = [(2, 4.0, 18.0, 2.25), (2, 4.5, 19.0, 2.75), (1, 9.0, 9.0, 9.0), (2, 4.4, 17.0, 2.5)]
    write_csv(tmp_path / 'tray_1_cor.csv', float_columns(fields, ('1', 's', 's', 's')), rows)
    assert draw(speeds, tmp_path / 'a', '--json') == 0
    values = json.loads(capsys.readouterr().out)
    assert (values['first'], values['last']) == (4.4, 18.0)


def test_an_oscillating_tray_is_fitted_from_the_start_of_the_cooling(table, tmp_path, capsys):
    oscillating = tmp_path / 'tray_1_speed.csv'
    oscillating.write_bytes(table.read_bytes())
    write_csv(
        tmp_path / 'tray_1_cor.csv',
        float_columns(
            ('status', 'window_start', 'window_end', 'cooling_start'), ('1', 's', 's', 's')
        ),
        [(2, 8.0, 20.0, 6.25)],
    )
    values = {}
    for source in (table, oscillating):
        output = tmp_path / 'a.png'
        assert main(['figure', 'decay', str(source), '-o', str(output), '--json', '--force']) == 0
        values[source] = json.loads(capsys.readouterr().out)
    assert values[table]['cooling_start'] == 0.0
    assert values[oscillating]['cooling_start'] == 6.25
    # The initial speed is that at the start of the cooling.
    early = values[table]['initial_speed'] / (1.0 + 6.25 / values[table]['haff_time'])
    assert values[oscillating]['initial_speed'] == pytest.approx(early, rel=0.15)
    assert (
        main(['figure', 'instantaneous', str(oscillating), '-o', str(output), '--json', '--force'])
        == 0
    )
    speeds = json.loads(capsys.readouterr().out)['collision_speed']
    assert max(speeds) < 2.2 * values[oscillating]['initial_speed']


def test_a_bag_is_analysed_first(tmp_path, capsys):
    folder = tmp_path / 'figures'
    # The bag says that it shows tray 1.
    assert draw(SAMPLE, folder, '--json', '--runs', '24') == 0
    values = json.loads(capsys.readouterr().out)
    assert values['cycles'] == 1
    assert values['first'] == pytest.approx(1.75, abs=0.2)
    assert all((folder / name).is_file() for name in FIGURES)
    assert (folder / 'results' / 'tray_1_speed.csv').is_file()


def test_of_a_bag_that_does_not_say_its_tray_the_tray_is_required(tmp_path, capsys):
    foreign = shutil.copytree(SAMPLE, tmp_path / 'foreign')
    path = foreign / 'metadata.yaml'
    document = yaml.safe_load(path.read_text())
    document['rosbag2_bagfile_information']['custom_data'] = {}
    path.write_text(yaml.safe_dump(document))
    assert draw(foreign, tmp_path / 'figures') == 2
    assert '--tray: is required with a bag' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('more', 'code', 'text'),
    [
        (('--widths', '0,0.9'), 2, '--widths'),
        (('--widths', '0.1'), 2, 'vary two numbers'),
        (('--beads', '0.5:1'), 2, '--beads'),
        (('--beads', '0.5,1.2'), 2, 'restitution'),
        (('--walls', '0.9'), 2, 'vary two numbers'),
        (('--runs', '0'), 2, '--runs'),
        (('--wall-restitution', '1.2'), 2, 'from 0 to 1'),
        (('--first', '5', '--last', '2'), 2, 'two times, rising'),
        (('--first', '90', '--last', '99'), 1, 'in common'),
        (('--tray', '9'), 2, 'tray 9'),
        (('--workers', '0'), 2, '--workers'),
    ],
)
def test_a_wrong_call_is_named_in_one_line(table, tmp_path, capsys, more, code, text):
    assert draw(table, tmp_path / 'figures', *more) == code
    error = capsys.readouterr().err
    assert text in error
    assert error.count('\n') == 1


def test_a_folder_with_other_files_is_not_changed(table, tmp_path, capsys):
    (tmp_path / 'mine.txt').write_text('mine')
    assert draw(table, tmp_path) == 1
    assert 'holds no figures of this command' in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['mine.txt']


def test_rising_speeds_are_an_error(tmp_path, capsys):
    rows = [(0.1 * k, 1, 0.0, 1e-3 + 1e-5 * k, 1e-4, 0.3) for k in range(1, 220)]
    assert draw(write_rows(tmp_path / 'tray_1_speed.csv', rows), tmp_path / 'a') == 1
    error = capsys.readouterr().err
    assert 'do not fall' in error
    assert error.count('\n') == 1
