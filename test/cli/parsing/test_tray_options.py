"""One meaning of trays in all commands: numbers, and a file that has its own option."""

from __future__ import annotations

from pathlib import Path

import pytest

from nanorocks_ros.cli.main import build_parser, main
from nanorocks_ros.errors import ConfigurationError

SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'
FLAGS = '--tray', '--trays', '--trays-file'


def leaves(parser):
    commands = parser.commands()
    if not commands:
        return [parser]
    return [leaf for command in commands.values() for leaf in leaves(command)]


PARSERS = {parser.prog: parser for parser in leaves(build_parser())}
OPTIONS = [
    (name, flag)
    for name, parser in PARSERS.items()
    for flag in FLAGS
    if flag in {item for action in parser.described() for item in action.option_strings}
]


@pytest.mark.parametrize(('name', 'flag'), OPTIONS)
def test_the_help_says_whether_a_number_or_a_file_is_meant(name, flag):
    action = PARSERS[name]._option_string_actions[flag]
    assert action.metavar == ('YAML' if flag == '--trays-file' else 'K')


def test_every_kind_is_tested():
    assert {flag for _, flag in OPTIONS} == set(FLAGS)
    assert len(OPTIONS) > 20


@pytest.mark.parametrize(
    'words',
    [
        ['calibrate', 'a', '--trays', 'mine.yaml'],
        ['cluster-curve', '-o', 'a.npz', '--trays', 'mine.yaml'],
        ['figure', 'packing', '--simulate', '-o', 'a.png', '--trays', 'mine.yaml'],
        ['figure', 'decay', 'a', '-o', 'a.png', '--tray', 'mine.yaml'],
        ['library', '-o', 'a.npz', '--tray', 'mine.yaml'],
        ['simulate', '--tray', 'mine.yaml'],
        ['track', str(SAMPLE), '--trays', 'mine.yaml'],
    ],
)
def test_a_file_in_place_of_a_number_is_refused_with_the_option_that_takes_it(capsys, words):
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "'mine.yaml' is no number of a tray; a file of trays is --trays-file mine.yaml" in line


@pytest.mark.parametrize('words', [['1', '3'], ['1,3'], ['1,', '3']])
@pytest.mark.parametrize('command', [['calibrate', 'a'], ['figure', 'packing', '-o', 'a']])
def test_numbers_are_separated_by_spaces_or_commas(command, words):
    options = build_parser().parse_args([*command, '--trays', *words])
    assert options.trays == (1, 3)


def test_numbers_of_a_setting_are_separated_by_spaces_or_commas():
    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.settings import PipelineSettings

    for words in (['1', '3'], ['1,3']):
        options = build_parser().parse_args(['analyse', 'a', '--trays', *words])
        assert settings_from(options, PipelineSettings()).trays == (1, 3)


@pytest.mark.parametrize('command', ['measure', 'analyse', 'track'])
def test_tray_is_accepted_for_both_where_a_recording_is_processed(command, capsys):
    words = [command, 'a', *(['-o', 'out'] if command == 'measure' else [])]
    options = build_parser().parse_args([*words, '--tray', 'mine.yaml', '--tray', '3'])
    assert (options.trays_file, options.trays) == ('mine.yaml', ['3'])
    assert '--tray ' not in PARSERS[f'nanorocks {command}'].format_full_help()
    assert 'use --trays-file mine.yaml' in capsys.readouterr().err


def test_the_tray_of_a_cluster_curve_is_accepted_as_one_of_its_trays():
    with pytest.raises(ConfigurationError):
        build_parser().parse_args(['cluster-curve', '-o', 'a.npz', '--tray', 'x'])
