"""Settings given as flags and in parameter files, under their current and their old names."""

from __future__ import annotations

import logging

import pytest

from nanorocks_ros.cli.flags import add_flags, settings_from
from nanorocks_ros.cli.parsing.command_parser import CommandParser
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import PipelineSettings

WARNING = "'tracking.fastest' is now called 'tracking.max_speed'"


def settings(*arguments, parameters=None):
    parser = CommandParser()
    add_flags(parser, PipelineSettings(), skip=set())
    return settings_from(parser.parse_args(arguments), PipelineSettings(), parameters)


def parameter_file(folder, text):
    path = folder / 'mine.yaml'
    path.write_text('/**:\n  ros__parameters:\n' + text)
    return str(path)


@pytest.mark.parametrize('flag', ['--pixels-per-metre', '--preprocess-pixels-per-metre'])
def test_the_scale_of_a_film_has_a_short_flag_too(flag):
    assert settings(flag, '9000').preprocess.pixels_per_metre == 9000.0


def test_the_flag_of_an_old_name_sets_the_setting_and_is_logged(caplog):
    with caplog.at_level(logging.WARNING):
        assert settings('--tracking-fastest', '0.1').tracking.max_speed == 0.1
    assert f'command line: {WARNING}' in caplog.text


def test_a_current_flag_logs_nothing(caplog):
    with caplog.at_level(logging.WARNING):
        assert settings('--tracking-max-speed', '0.1').tracking.max_speed == 0.1
    assert not caplog.records


def test_an_old_flag_does_not_appear_in_the_help():
    parser = CommandParser()
    add_flags(parser, PipelineSettings(), skip=set())
    text = parser.format_full_help()
    assert '--tracking-max-speed' in text
    assert '--tracking-fastest' not in text


def test_the_old_and_the_new_flag_together_are_refused():
    with pytest.raises(ConfigurationError, match='are the same setting'):
        settings('--tracking-fastest', '0.1', '--tracking-max-speed', '0.1')


@pytest.mark.parametrize(
    'text', ['    tracking.fastest: 0.1\n', '    tracking:\n      fastest: 0.1\n']
)
def test_a_file_with_an_old_name_sets_the_setting_and_is_logged(tmp_path, caplog, text):
    path = parameter_file(tmp_path, text)
    with caplog.at_level(logging.WARNING):
        assert settings(parameters=path).tracking.max_speed == 0.1
    assert f'{path}: {WARNING}' in caplog.text


def test_a_flag_overrides_the_file_whichever_name_each_of_them_uses(tmp_path):
    path = parameter_file(tmp_path, '    tracking.fastest: 0.1\n')
    assert settings('--tracking-max-speed', '0.2', parameters=path).tracking.max_speed == 0.2
