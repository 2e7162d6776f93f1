"""Films are accepted wherever bags are."""

from __future__ import annotations

import json

import pytest
from videos import write_video

from nanorocks_ros.cli.film_inputs import use_imports
from nanorocks_ros.cli.main import build_parser, main


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
