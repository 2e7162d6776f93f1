"""Films are accepted wherever bags are."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from videos import write_video

from nanorocks_ros.cli.imported_films import use_imports
from nanorocks_ros.cli.main import build_parser, main
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.outputs.tables.table_files import write_package
from nanorocks_ros.studies.film_import.film_cache import is_film

COLUMNS = float_columns(('time', 'x'), ('s', 'm'))


def test_info_of_a_film_says_that_it_was_imported_once(tmp_path, capsys):
    film = write_video(tmp_path / 'a.avi', range(8))
    for how in ('imported, 8 frames', 'its import is used, 8 frames'):
        assert main(['info', str(film), '--json']) == 0
        printed = capsys.readouterr()
        assert json.loads(printed.out)['topics'][0]['count'] == 8
        assert f'nanorocks: {film}: {how}' in printed.err


@pytest.mark.parametrize('command', ['track', 'look', 'statistics', 'autocorrelation', 'speeds'])
def test_commands_on_a_bag_take_films(tmp_path, command):
    film = write_video(tmp_path / 'a.avi', range(4))
    options = build_parser().parse_args([command, str(film)])
    use_imports(options)
    assert options.named == [str(film)]
    assert options.bag == str(tmp_path / '.nanorocks' / 'a.avi')


def test_a_pattern_names_films_and_bags(tmp_path):
    for name in ('b.avi', 'a.avi'):
        write_video(tmp_path / name, range(4))
    options = build_parser().parse_args(['analyse', str(tmp_path / '*.avi')])
    use_imports(options)
    cache = tmp_path / '.nanorocks'
    assert options.bags == [str(cache / 'a.avi'), str(cache / 'b.avi')]


def test_what_is_no_film_is_left_to_the_reader_of_bags(tmp_path, capsys):
    (tmp_path / 'notes.txt').write_text('text')
    assert main(['info', str(tmp_path / 'notes.txt')]) == 1
    assert main(['info', str(tmp_path / 'missing.avi')]) == 1
    assert 'Traceback' not in capsys.readouterr().err


def test_analyse_says_first_how_a_film_of_unknown_beads_is_measured(tmp_path, capsys):
    film = write_video(tmp_path / 'my film.avi', range(4))
    use_imports(build_parser().parse_args(['analyse', str(film)]))
    lines = capsys.readouterr().err.splitlines()
    assert 'does not say which trays it shows' in lines[0]
    assert f"nanorocks measure '{film}' --diameter-px auto -o 'my film_measured'" in lines[0]
    assert f"nanorocks analyse '{film}' --trays 3" in lines[0]
    assert 'imported, 4 frames' in lines[-1]


@pytest.mark.parametrize('told', [('--trays', '3'), ('--trays-file', 'mine.yaml')])
def test_analyse_says_nothing_where_the_trays_are_told(tmp_path, capsys, told):
    film = write_video(tmp_path / 'a.avi', range(4))
    use_imports(build_parser().parse_args(['analyse', str(film), *told]))
    assert 'which trays' not in capsys.readouterr().err


def refused(arguments, capsys):
    """The one line with which a command refuses its input."""
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    return error


@pytest.fixture
def results(tmp_path):
    """A folder of results with pictures, as of `nanorocks measure`."""
    folder = tmp_path / 'results'
    provenance = {'command': 'nanorocks measure my.avi', 'source': 'my.avi'}
    folder.mkdir()
    write_package(folder, {'tracks.csv': COLUMNS}, provenance)
    cv2.imwrite(str(folder / 'tracks.png'), np.zeros((20, 20), np.uint8))
    return folder


@pytest.mark.parametrize(
    'command', ['speeds', 'measure', 'analyse', 'track', 'info', 'look', 'statistics', 'tray']
)
def test_a_folder_of_results_is_no_film_and_its_film_is_named(results, capsys, command):
    options = ['-o', str(results / 'new')] if command in ('measure', 'tray') else []
    error = refused([command, str(results), *options], capsys)
    assert f'{results}: is a folder of results, not a film or a bag' in error
    assert 'here my.avi' in error


def test_import_takes_no_pictures_of_results(results, tmp_path, capsys):
    assert 'here my.avi' in refused(['import', str(results), '-o', str(tmp_path / 'b')], capsys)
    write_video(tmp_path / 'a.avi', range(4))
    assert main(['import', '--each', str(tmp_path), '-o', str(tmp_path / 'bags')]) == 0
    assert [bag.name for bag in (tmp_path / 'bags').iterdir()] == ['a']


def test_images_beside_a_description_of_other_data_are_a_film(results):
    (results / 'datapackage.json').write_text('{"resources": []}')
    assert is_film(results)


def test_a_missing_film_is_answered_by_the_nearest_name(tmp_path, capsys):
    write_video(tmp_path / 'my film.avi', range(4))
    error = refused(['info', str(tmp_path / 'my_film.avi')], capsys)
    assert f"does not exist; did you mean '{tmp_path / 'my film.avi'}'?" in error
    far = refused(['info', str(tmp_path / 'other.mkv')], capsys)
    assert 'does not exist; name a video, a folder of images or a bag' in far


def test_what_is_neither_film_nor_bag_is_told_apart(tmp_path, capsys):
    (tmp_path / 'mine.yaml').write_text('trays: {}')
    cv2.imwrite(str(tmp_path / 'one.png'), np.zeros((20, 20), np.uint8))
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'videos').mkdir()
    film = write_video(tmp_path / 'videos' / 'a.avi', range(4))
    assert 'trays is given by --trays-file' in refused(
        ['info', str(tmp_path / 'mine.yaml')], capsys
    )
    assert 'the folder of all its images' in refused(['info', str(tmp_path / 'one.png')], capsys)
    assert 'without a recording' in refused(['info', str(tmp_path / 'empty')], capsys)
    folder = refused(['info', str(tmp_path / 'videos')], capsys)
    assert f'is a folder of 1 recording; name one, such as {film}' in folder
    assert main(['import', str(film), '-o', str(tmp_path / 'bags' / 'a')]) == 0
    capsys.readouterr()
    folder = refused(['info', str(tmp_path / 'bags')], capsys)
    assert f'is a folder of 1 recording; name one, such as {tmp_path / "bags" / "a"}' in folder


def test_notices_name_the_film_and_not_its_import(tmp_path, capsys):
    film = write_video(tmp_path / 'a.avi', range(8))
    scale = '--preprocess-pixels-per-metre', '3000'
    assert main(['look', str(film), '--at', '0', *scale]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if '.nanorocks' in line] == [
        f'nanorocks: {film}: imported, 8 frames in {tmp_path / ".nanorocks" / "a.avi"}'
    ]
    assert f'nanorocks: {film}: neither camera_info nor a calibration file' in '\n'.join(lines)
