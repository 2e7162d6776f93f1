"""Commands take trays, beads and scale from a bag where nothing is told: round trips."""

from __future__ import annotations

import json
import shutil

import cv2
import pytest
import yaml

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.analysis.results.results_folder import trays_file_of

OWN_TRAY = """\
# as glued in May
trays:
  2:
    dimensions_mm: [16, 16, 3.5]
    species:
      - {material: acrylic, diameter_mm: 2, count: 12}
"""
SHORT = ('--duration', '1', '--frame-rate', '12', '--first-shake', '0.3', '--effects', 'none')
SMALL = ('--pixels-per-metre', '9000', '--width-px', '480', '--height-px', '176')


def run(capsys, *arguments):
    """Run a command; its exit code, standard output and standard error."""
    code = main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    return code, printed.out, printed.err


@pytest.fixture(scope='module')
def tray_3(tmp_path_factory):
    bag = tmp_path_factory.mktemp('simulated') / 'tray_3'
    assert main(['simulate', '--tray', '3', '--bag', str(bag), *SHORT, *SMALL]) == 0
    return bag


@pytest.fixture(scope='module')
def own_tray(tmp_path_factory):
    folder = tmp_path_factory.mktemp('own')
    path = folder / 'mine.yaml'
    path.write_text(OWN_TRAY)
    bag = folder / 'bag'
    arguments = ['simulate', '--trays-file', str(path), '--bag', str(bag), *SHORT, *SMALL]
    assert main(arguments) == 0
    path.unlink()
    return bag


def test_a_simulated_bag_of_tray_3_is_analysed_as_tray_3(tray_3, capsys):
    code, out, _ = run(capsys, 'analyse', tray_3, '--json', '--no-output')
    analysis = json.loads(out)
    assert code == 0
    assert list(analysis['trays']) == ['3']
    assert not any('assumed' in text or 'looks wrong' in text for text in analysis['notices'])


@pytest.mark.parametrize('command', ['track', 'look', 'speeds'])
def test_other_commands_take_the_tray_from_the_bag(command, tray_3, capsys):
    code, out, error = run(capsys, command, tray_3, '--json')
    assert code == 0
    assert list(json.loads(out)['trays']) == ['3']
    assert 'assumed' not in error


def test_what_is_told_wins_and_the_contradiction_is_said_once(tray_3, capsys):
    code, out, error = run(capsys, 'look', tray_3, '--json', '--trays', '1')
    assert code == 0
    assert list(json.loads(out)['trays']) == ['1']
    assert error.count('says trays 3') == 1


def test_a_bag_keeps_the_trays_file_that_is_moved_away(own_tray, tmp_path, capsys):
    code, out, _ = run(capsys, 'track', own_tray, '--json')
    assert code == 0
    (species,) = json.loads(out)['trays']['2']['species']
    assert species['expected'] == 12
    results = tmp_path / 'results'
    code, _, error = run(capsys, 'analyse', own_tray, '-o', results, '--cooling-relation', 'paper')
    assert code == 0, error
    # Figures take it from the results.
    assert trays_file_of(results) == OWN_TRAY
    assert load_trays(trays_file_of(results))[2].count == 12


def test_a_bag_of_flown_trays_keeps_no_trays_file(tray_3, tmp_path, capsys):
    results = tmp_path / 'results'
    assert run(capsys, 'analyse', tray_3, '-o', results)[0] == 0
    assert trays_file_of(results) == ''
    assert trays_file_of(tmp_path) == ''


def images_of(bag, folder):
    folder.mkdir()
    for number, frame in enumerate(BagFrames(bag).frames()):
        cv2.imwrite(str(folder / f'f_{number:04}.png'), frame.image)
    return folder


def test_an_import_keeps_what_it_is_told(tray_3, tmp_path, capsys):
    images = images_of(tray_3, tmp_path / 'images')
    bag = tmp_path / 'bag'
    told = ('--trays', '3', '--pixels-per-metre', '9000')
    assert run(capsys, 'import', images, '-o', bag, '--rate', '12', *told)[0] == 0
    code, out, error = run(capsys, 'track', bag, '--json')
    assert code == 0
    assert list(json.loads(out)['trays']) == ['3']
    assert 'assumed' not in error
    # A copy without metadata.yaml has them in the MCAP file.
    (file,) = bag.glob('*.mcap')
    alone = shutil.copy(file, tmp_path / 'alone.mcap')
    assert open_bag(alone).metadata['experiment.trays'] == '3'


def test_an_import_without_a_tray_leaves_it_to_be_assumed_aloud(tray_3, tmp_path, capsys):
    images = images_of(tray_3, tmp_path / 'images')
    bag = tmp_path / 'bag'
    assert run(capsys, 'import', images, '-o', bag, '--rate', '12')[0] == 0
    arguments = ('--json', '--preprocess-pixels-per-metre', '9000')
    code, out, error = run(capsys, 'look', bag, *arguments)
    assert code == 0
    assert list(json.loads(out)['trays']) == ['1']
    assert error.count('tray 1 is assumed') == 1


@pytest.mark.parametrize(
    ('told', 'words'),
    [
        (('--trays', '9'), 'trays: 9 is outside'),
        (('--trays', 'x'), "'x'"),
        (('--trays', '3', '--trays-file', 'nowhere.yaml'), 'nowhere.yaml'),
        (('--pixels-per-metre', '-4'), 'outside'),
        (('--trays', '3', '--regions-px', '1', '2', '3'), '3 numbers for 1 trays'),
    ],
)
def test_an_import_refuses_what_cannot_be(told, words, tmp_path, capsys):
    code, _, error = run(capsys, 'import', tmp_path, '-o', tmp_path / 'bag', *told)
    assert code == 2
    assert words in error
    assert error.count('\n') == 1


def test_a_batch_analyses_each_bag_by_what_it_says(tray_3, own_tray, tmp_path, capsys):
    results = tmp_path / 'results'
    code, out, error = run(
        capsys, 'analyse', tray_3, own_tray, '-o', results, '--json', '--workers', '1',
        '--cooling-relation', 'paper',
    )  # fmt: skip
    assert code == 0, error
    batch = json.loads(out)
    assert [list(bag['trays']) for bag in batch['bags']] in ([['3'], ['2']], [['2'], ['3']])
    assert sorted(batch['trays']) == ['2', '3']


def test_a_batch_refuses_diameters_that_are_not_told_once(tray_3, own_tray, tmp_path, capsys):
    path = tmp_path / 'mine.yaml'
    path.write_text(OWN_TRAY.replace('diameter_mm: 2', 'look: auto, diameter_mm: auto'))
    results = tmp_path / 'results'
    code, _, error = run(capsys, 'analyse', tray_3, own_tray, '-o', results, '--trays-file', path)
    assert code == 2
    assert error.count('\n') == 1
    assert f'`nanorocks track FILM --trays-file {path}` finds it' in error
    assert not results.exists()


def test_a_tray_with_other_beads_is_left_out_of_the_means_of_a_batch(own_tray, tmp_path, capsys):
    path = tmp_path / 'mine.yaml'
    path.write_text(OWN_TRAY.replace('count: 12', 'count: 9'))
    other = tmp_path / 'other'
    simulate = ('simulate', '--trays-file', path, '--bag', other, *SHORT, *SMALL)
    assert run(capsys, *simulate)[0] == 0
    code, out, error = run(
        capsys, 'analyse', own_tray, other, '-o', tmp_path / 'results', '--json', '--workers', '1',
        '--cooling-relation', 'paper',
    )  # fmt: skip
    assert code == 0, error
    assert len(json.loads(out)['bags']) == 2
    assert error.count('its tray 2 holds other beads') == 1


@pytest.mark.parametrize('key', ['trays', 'trays_file'])
def test_hostile_metadata_ends_a_command_in_one_line(key, tray_3, tmp_path, capsys):
    bag = tmp_path / 'bag'
    shutil.copytree(tray_3, bag)
    path = bag / 'metadata.yaml'
    document = yaml.safe_load(path.read_text())
    content = document['rosbag2_bagfile_information']['custom_data']
    # Below the limit of what a YAML text may hold.
    content[f'experiment.{key}'] = [['x'] * 100_000] * 5
    path.write_text(yaml.safe_dump(document))
    code, _, error = run(capsys, 'track', bag)
    assert code == 1
    assert error.count('\n') == 1
    assert f'experiment.{key}' in error
