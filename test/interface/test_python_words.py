"""Flags of the command in the words of Python."""

from __future__ import annotations

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.interface.python_words import in_python, python_words
from nanorocks_ros.settings import SETTINGS_LISTED


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('it needs --corners and --height-mm', 'it needs corners and height_mm'),
        ('raise it: --tracking-max-speed 3', 'raise it: tracking.max_speed 3'),
        ('pass --include-inconsistent', 'pass cooling.include_inconsistent'),
        ('run `nanorocks look BAG --at 3`', 'run `nanorocks look BAG --at 3`'),
        (SETTINGS_LISTED, SETTINGS_LISTED),
        ('nanorocks tray FILM --rate 3; or --rate', 'nanorocks tray FILM --rate 3; or rate'),
        ('pass --start', 'pass --start of `nanorocks import`'),
        ('a -- b, 1--2', 'a -- b, 1--2'),
        ('lower --prior-min-wall-restitution', 'lower prior.min_wall_restitution'),
    ],
)
def test_flags_become_keywords_and_settings(text, words):
    assert python_words(text) == words


def test_an_error_keeps_its_kind_and_its_cause():
    first = ConfigurationError('--corners', 'are 3 numbers', 'give --corners X Y X Y')
    with pytest.raises(ConfigurationError, match='corners: are 3 numbers') as raised, in_python():
        raise first
    assert raised.value.do == 'give corners X Y X Y'
    assert raised.value.__cause__ is first


def test_an_error_without_flags_is_raised_as_it_is():
    first = ConfigurationError('film', 'is empty', 'record it again')
    with pytest.raises(ConfigurationError) as raised, in_python():
        raise first
    assert raised.value is first
