"""Recordings and settings as a user of Python names them."""

from __future__ import annotations

from pathlib import Path

import pytest

import nanorocks_ros as nr
from nanorocks_ros.interface.inputs import named_paths, settings_of, told_settings

BAGS = Path(__file__).resolve().parents[2] / 'bags'
SAMPLE = BAGS / 'tray_1_sample'


def test_one_path_many_a_pattern_and_a_folder_name_recordings():
    assert named_paths(SAMPLE) == [SAMPLE]
    assert named_paths(str(SAMPLE)) == [SAMPLE]
    assert named_paths([SAMPLE, 'x']) == [SAMPLE, Path('x')]
    assert named_paths(f'{BAGS}/tray_*') == [SAMPLE]
    assert [path.name for path in named_paths(BAGS)] == ['tray_1_sample']


@pytest.mark.parametrize(('named', 'problem'), [([], 'none is named'), ('no*thing', 'nothing')])
def test_nothing_to_read_is_an_error(named, problem):
    with pytest.raises(nr.RecordingError, match=problem):
        named_paths(named)


def test_settings_are_told_by_name_or_by_keyword():
    told = told_settings({'cooling.duration': 15}, 1, '')
    settings = settings_of(SAMPLE, told).settings
    assert settings.cooling.duration == 15.0
    assert settings.trays == (1,)


@pytest.mark.parametrize(
    ('name', 'meant'),
    [('coling.duration', 'cooling.duration'), ('max_sped', 'tracking.max_speed')],
)
def test_a_wrong_setting_is_answered_with_the_one_that_may_be_meant(name, meant):
    with pytest.raises(nr.ConfigurationError, match=f'did you mean {meant}'):
        nr.analyse(SAMPLE, settings={name: 3})


@pytest.mark.parametrize(
    ('call', 'problem'),
    [
        (lambda: nr.track(SAMPLE, diameter=31), 'did you mean diameter_px'),
        (lambda: nr.track(SAMPLE, count=3), 'count: needs diameter_px'),
        (lambda: nr.track(SAMPLE, diameter_px=31, corners=[1, 2, 3]), 'corners: 3 numbers'),
        (lambda: nr.simulate(restitutoin=0.9), 'did you mean restitution'),
        (lambda: nr.simulate(restitution=1.9), 'outside'),
        (lambda: nr.simulate(film='film.gif'), 'ends in .gif'),
        (lambda: nr.simulate(tray=9), 'outside'),
    ],
)
def test_a_wrong_call_is_told_in_the_words_of_python(call, problem):
    with pytest.raises(nr.ConfigurationError, match=problem) as raised:
        call()
    # Flags stand in commands alone, in backquotes.
    assert '--' not in ''.join(str(raised.value).split('`')[::2])


@pytest.mark.parametrize('function', [nr.analyse, nr.track, nr.measure, nr.read])
def test_what_does_not_exist_is_a_recording_error(function):
    with pytest.raises(nr.RecordingError, match='nowhere'):
        function('nowhere')
