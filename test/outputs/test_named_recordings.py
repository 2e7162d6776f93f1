"""Commands in remedies name the recording that they are about."""

from __future__ import annotations

import shlex

from nanorocks_ros.cli.main import build_parser
from nanorocks_ros.outputs.named_recordings import with_film, with_recording
from nanorocks_ros.records import Quality
from nanorocks_ros.records.result_words import flags_in_words

REMEDY = 'look at it with `nanorocks look BAG -o steps.png`; or nanorocks track FILM --picture a'


def test_a_name_with_spaces_is_quoted():
    assert with_recording(REMEDY, 'my runs/run 7') == (
        "look at it with `nanorocks look 'my runs/run 7' -o steps.png`; "
        "or nanorocks track 'my runs/run 7' --picture a"
    )


def test_texts_at_any_depth_are_named_and_other_values_stay():
    values = {'flags': [{'remedy': REMEDY, 'speeds': 3}], 'reason': None, 'lines': (REMEDY,)}
    named = with_recording(values, 'run')
    assert named['flags'][0] == {'remedy': with_recording(REMEDY, 'run'), 'speeds': 3}
    assert named['reason'] is None
    assert named['lines'] == [with_recording(REMEDY, 'run')]


def test_a_name_that_looks_like_a_pattern_is_taken_as_it_is():
    assert with_recording('nanorocks look BAG', r'a\1\g<0>') == r"nanorocks look 'a\1\g<0>'"


def test_no_remedy_of_a_flag_keeps_a_placeholder():
    """And every command in a remedy of a flag that names the recording can be parsed."""
    parsed = 0
    for flag in flags_in_words(~Quality(0)):
        named = with_recording(flag.remedy, 'a b')
        assert 'BAG' not in named
        for command in named.split('`')[1::2]:
            words = shlex.split(command)
            if 'a b' in words:
                assert build_parser().parse_args(words[1:]).bag == 'a b'
                parsed += 1
    assert parsed


def test_a_film_is_named_in_place_of_its_import_and_a_bag_stays():
    notice = 'a/.nanorocks/f.avi: /nanorocks/camera/image_raw: 3 frames are damaged'
    assert with_film(notice, 'a/.nanorocks/f.avi', 'a/f.avi') == 'a/f.avi: 3 frames are damaged'
    other = 'a/.nanorocks/f.avi_measured: kept'
    assert with_film(other, 'a/.nanorocks/f.avi', 'a/f.avi') == other
    assert with_film(notice, 'a/.nanorocks/f.avi', 'a/.nanorocks/f.avi') == notice
