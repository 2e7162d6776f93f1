"""Commands in remedies repeat the user's own files."""

from __future__ import annotations

import shlex
from argparse import Namespace

import pytest

from nanorocks_ros.cli.main import build_parser, main
from nanorocks_ros.cli.remedies import about_own_recording, with_own_files

TEXT = 'make one: nanorocks library --tray 3 -o tray_3.npz, and pass it'
TRAY = """materials:
  steel: {density_g_cm3: 7.85, color_bgr: [90, 90, 90]}
trays:
  1:
    dimensions_mm: [60, 40, 4]
    species:
      - {material: steel, diameter_mm: 2, count: COUNT}
"""


def test_the_trays_file_is_repeated_and_quoted():
    own = with_own_files(TEXT, Namespace(trays_file='my trays.yaml'))
    assert "nanorocks library --tray 3 --trays-file 'my trays.yaml' -o tray_3.npz" in own
    # Texts that were written into results are said again.
    assert with_own_files(own, Namespace(trays_file='my trays.yaml')) == own


def test_a_recording_and_the_options_that_describe_it_are_repeated():
    text = 'look at it with `nanorocks look BAG --at 2 -o a.png`, or nanorocks measure FILM'
    options = build_parser().parse_args(
        ['analyse', 'x', '--trays', '1', '3', '--preprocess-pixels-per-metre', '9000']
    )
    options.named = ['my runs/run 7']
    described = "'my runs/run 7' --trays 1 3 --preprocess-pixels-per-metre 9000"
    assert with_own_files(text, options) == (
        f'look at it with `nanorocks look {described} --at 2 -o a.png`, '
        f"or nanorocks measure {described} -o 'run 7_measured'"
    )


def test_a_described_film_is_described_again_where_the_command_takes_it():
    words = ['track', 'a.mp4', '--diameter-px', '31', '20', '--count', '5', '6']
    options = build_parser().parse_args(words)
    options.named, options.trays_file = ['a.mp4'], 'trays:\n  1: {}\n'
    assert with_own_files('nanorocks track BAG --picture a.png', options) == (
        'nanorocks track a.mp4 --diameter-px 31.0 20.0 --count 5 6 --picture a.png'
    )
    assert with_own_files('nanorocks look BAG', options) == 'nanorocks look a.mp4'


def test_several_recordings_are_not_named():
    assert (
        with_own_files('nanorocks look BAG', Namespace(named=['a', 'b'])) == 'nanorocks look BAG'
    )


def test_remedies_of_json_repeat_the_recording_and_its_options():
    options = build_parser().parse_args(['analyse', 'x', '--trays', '3', '--json'])
    options.named = ['run 7']
    values = {'flags': [{'name': 'glare', 'remedy': 'see `nanorocks look BAG`'}], 'reason': None}
    assert about_own_recording(values, options) == {
        'flags': [{'name': 'glare', 'remedy': "see `nanorocks look 'run 7' --trays 3`"}],
        'reason': None,
    }


def test_commands_in_remedies_can_be_parsed():
    """What is suggested is a call that the parser takes, with the options repeated."""
    options = build_parser().parse_args(['track', 'a', '--trays', '2', '--trays-file', 'my.yaml'])
    options.named = ['a b']
    for text in (
        'nanorocks look BAG --at 2 -o steps.png',
        'nanorocks speeds BAG -o speeds.png',
        'nanorocks track BAG --picture tracks.png',
        'nanorocks measure FILM',
        'nanorocks library --tray 3 -o tray_3.npz',
        'nanorocks cluster-curve --trays 3 -o curve.npz',
    ):
        command = shlex.split(with_own_files(text, options))
        parsed = build_parser().parse_args(command[1:])
        assert parsed.trays_file == 'my.yaml'


@pytest.mark.parametrize('options', [None, Namespace(), Namespace(trays_file='a: 1\nb: 2\n')])
def test_without_a_file_the_remedy_stays(options):
    assert with_own_files(TEXT, options) == TEXT


def test_a_library_of_a_single_bead_is_refused_in_one_line(tmp_path, capsys):
    (tmp_path / 't.yaml').write_text(TRAY.replace('COUNT', '1'))
    arguments = ['--tray', '1', '--trays-file', str(tmp_path / 't.yaml')]
    code = main(['library', *arguments, '-o', str(tmp_path / 'a.npz')])
    printed = capsys.readouterr().err
    assert code == 2
    assert 'nanorocks measure' in printed
    assert 'Traceback' not in printed
