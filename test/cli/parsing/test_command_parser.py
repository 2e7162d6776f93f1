"""Short and full help, wrong calls in one line, hints where a word is misspelt."""

from __future__ import annotations

import pytest

from nanorocks_ros.cli.main import COMMANDS, build_parser, main

# About ten: the arguments, the help and the everyday options.
MOST_SHOWN = 12


def leaves(parser):
    commands = parser.commands()
    if not commands:
        return [parser]
    return [leaf for command in commands.values() for leaf in leaves(command)]


PARSERS = {parser.prog: parser for parser in leaves(build_parser())}


@pytest.mark.parametrize('name', PARSERS)
def test_the_short_help_shows_about_ten_options_and_names_the_full_one(name):
    parser = PARSERS[name]
    assert len(parser.shown()) <= MOST_SHOWN
    hidden = [action for action in parser.described() if action not in parser.shown()]
    text = parser.format_help()
    assert (f'{name} --help-all' in text) == (len(hidden) > 1)
    for action in parser.shown():
        assert all(flag in text for flag in action.option_strings)


@pytest.mark.parametrize('name', PARSERS)
def test_the_full_help_shows_every_option_with_a_placeholder_that_means_something(name):
    parser = PARSERS[name]
    text = parser.format_full_help()
    for action in parser.described():
        assert all(flag in text for flag in action.option_strings)
        assert action.metavar not in ('V', '')
        assert action.help


def test_settings_are_grouped_by_stage_with_choices_and_units():
    text = PARSERS['nanorocks analyse'].format_full_help()
    assert text.index('preprocess: from the camera frame') < text.index('tracking: from colour')
    assert '--speed-method {auto,tracking,structure_function,binarised_area}' in text
    assert '--tracking-max-speed M/S' in text
    assert '--preprocess-stabilise on|off' in text


def test_a_command_alone_is_parsed_as_among_all_and_completion_knows_all():
    commands = build_parser().commands()
    for name, parser in commands.items():
        alone = build_parser(name).commands()
        assert alone[name].format_full_help() == parser.format_full_help()
        assert set(alone) == (set(commands) if name == 'completion' else {name})
    assert set(build_parser('no-command').commands()) == set(commands)


def test_the_commands_are_listed_by_task(capsys):
    assert set(build_parser().commands()) == {name for task in COMMANDS.values() for name in task}
    with pytest.raises(SystemExit) as ended:
        main(['--help'])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    places = [text.index(f'\n{task}:\n') for task in COMMANDS]
    assert places == sorted(places)


@pytest.mark.parametrize('words', [[], ['figure']])
def test_without_a_command_the_help_is_printed(capsys, words):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0
    printed = capsys.readouterr()
    assert printed.out.startswith('usage: nanorocks')
    assert not printed.err


@pytest.mark.parametrize(
    ('words', 'line'),
    [
        (['analyze', 'a'], 'analyze: no command of nanorocks; did you mean analyse?'),
        (['figure', 'dcay'], 'dcay: no command of nanorocks figure; did you mean decay?'),
        (['qqq'], 'qqq: no command of nanorocks; see nanorocks --help'),
        (
            ['speeds', '--rate'],
            '--rate: no option of nanorocks speeds; see nanorocks speeds --help-all',
        ),
        (['--vrsion'], '--vrsion: no option of nanorocks; did you mean --version?'),
        # Before anything is said to be missing.
        (
            ['measure', 'a', '--diametr-px=3'],
            '--diametr-px: no option of nanorocks measure; did you mean --diameter-px or '
            '--diameter-mm?',
        ),
        (
            ['analyse', 'a', '--format', 'parket'],
            "--format: 'parket' is none of csv, parquet; did you mean parquet?",
        ),
        (
            ['simulate', '--runs', 'x'],
            "--runs: invalid int value: 'x'; see nanorocks simulate --help",
        ),
        (
            ['analyse'],
            'the following arguments are required: BAG; see nanorocks analyse --help',
        ),
    ],
)
def test_a_wrong_call_is_one_line_with_what_to_do(capsys, words, line):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert capsys.readouterr().err == f'nanorocks: {line}\n'


@pytest.mark.parametrize(
    'words',
    [
        ['measure', '-o', 'out', '--diameter-px', '27', 'my film.mp4'],
        ['calibrate', '--trays', '1', 'my film.mp4'],
        ['analyse', '--trays', '1', 'my film.mp4'],
    ],
)
def test_a_film_behind_numbers_is_told_to_stand_before_them(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'my film.mp4').touch()
    (tmp_path / 'out').mkdir()
    try:
        code = main(words)
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    assert capsys.readouterr().err.endswith("; write 'my film.mp4' before the options\n")


def test_a_folder_for_results_is_not_taken_for_a_film(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'out').mkdir()
    with pytest.raises(SystemExit):
        main(['measure', '-o', 'out'])
    error = capsys.readouterr().err
    assert error == (
        'nanorocks: the following arguments are required: BAG; see nanorocks measure --help\n'
    )


@pytest.mark.parametrize('name', PARSERS)
def test_a_help_begins_with_a_sentence(name):
    description = PARSERS[name].description or ''
    assert description[:1].isupper()
    assert description.endswith('.')


def test_a_misspelt_value_of_a_setting_has_a_hint(capsys):
    assert main(['simulate', '--sticking-measure', 'nromal']) == 2
    assert 'is none of normal, total, did you mean normal?' in capsys.readouterr().err


def test_flags_may_be_abbreviated_where_one_is_meant():
    options = build_parser().parse_args(['analyse', '--trays-f', 'mine.yaml', '--', '--b'])
    assert (options.trays_file, options.bags) == ('mine.yaml', ['--b'])
