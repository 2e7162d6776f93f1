"""The text of an interrupted block, however the interruption arrives."""

from __future__ import annotations

import zipfile

import pytest

from nanorocks_ros.jobs.interruption import interruption_says


def pressed():
    raise KeyboardInterrupt


def in_a_call_from_compiled_code():
    try:
        pressed()
    except KeyboardInterrupt as interruption:
        raise SystemError('returned a result with an exception set') from interruption


def while_an_archive_is_written(tmp_path):
    with zipfile.ZipFile(tmp_path / 'a.zip', 'w') as archive:
        member = archive.open('a', 'w')
        pressed()
        member.close()


def interrupted(arrives, message):
    with pytest.raises(KeyboardInterrupt) as interruption, interruption_says(message):
        arrives()
    return str(interruption.value)


def test_an_interruption_says_what_is_kept():
    kept = []

    def work():
        kept.extend((1, 2))
        pressed()

    assert interrupted(work, lambda: f'{len(kept)} parts are kept') == '2 parts are kept'


def test_an_interruption_that_became_another_error_says_it_too(tmp_path):
    for arrives in (in_a_call_from_compiled_code, lambda: while_an_archive_is_written(tmp_path)):
        with pytest.raises((SystemError, ValueError)):
            arrives()
        assert interrupted(arrives, 'the same command goes on') == 'the same command goes on'


def test_other_errors_are_raised_as_they_are():
    with pytest.raises(ValueError, match='no number'), interruption_says('nothing is kept'):
        raise ValueError('no number')
