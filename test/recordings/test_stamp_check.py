"""One far-future stamp is an impossible stamp, not billions of lost frames."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.recordings.stamp_check import StampCheck
from nanorocks_ros.records import NS

START, FUTURE, DAY = 1_000_000_000 * NS, (2**31 - 1) * NS, 86_400 * NS


def results(stamps):
    """Every frame, named by its stamp, and why it is refused."""
    check = StampCheck('bag: /camera')
    decided = [result for stamp in stamps for result in check.push(stamp, stamp)]
    return decided + check.end()


def checked(stamps):
    """The stamps that are kept; None in the place of a refused frame."""
    assert [stamp for stamp, _ in results(stamps)] == list(stamps)
    return [None if refusal else stamp for stamp, refusal in results(stamps)]


@given(length=st.integers(3, 12), data=st.data())
def test_a_single_far_stamp_is_refused_wherever_it_is(length, data):
    stamps = [START + number * NS // 30 for number in range(length)]
    place = data.draw(st.integers(0, length - 1))
    far = data.draw(st.sampled_from([FUTURE, 1, START + 40 * DAY]))
    changed = [*stamps[:place], far, *stamps[place + 1 :]]
    assert checked(changed) == [None if k == place else s for k, s in enumerate(stamps)]


def test_a_clock_that_was_set_is_kept():
    stamps = [1 * NS, 2 * NS, START, START + NS, START + 2 * NS]
    assert checked(stamps) == stamps


def test_a_long_pause_is_kept_by_its_limit(monkeypatch):
    stamps = [START, START + NS, START + 60 * DAY]
    assert checked(stamps)[-1] is None
    monkeypatch.setenv('NANOROCKS_MAX_PAUSE_SECONDS', str(61 * 86_400))
    assert checked(stamps) == stamps


@pytest.mark.parametrize('count', [0, 1, 2])
def test_few_frames_have_no_neighbours_to_judge_by(count):
    stamps = [FUTURE + number for number in range(count)]
    assert checked(stamps) == stamps


@pytest.mark.parametrize('far', [10 * NS, -10 * NS, 3600 * NS, -20 * DAY])
def test_a_lone_jump_within_the_limit_is_refused_too(far):
    stamps = [START, START + NS, START + 2 * NS + far, START + 3 * NS]
    assert checked(stamps) == [*stamps[:2], None, stamps[3]]


@pytest.mark.parametrize(
    'seconds',
    [
        (0, 1, 61, 62),  # a pause
        (0, 1, 61),  # a pause before the last frame
        (0, 10, 20, 30),  # a slow camera
        (0, 1, 40, 41, 3, 4),  # seeks
        (100, 101, 0, 1, 100, 101, 0, 1),  # a loop
    ],
)
def test_pauses_seeks_and_loops_are_kept(seconds):
    stamps = [START + second * NS for second in seconds]
    assert checked(stamps) == stamps


def test_a_frame_is_released_when_none_follows_unless_it_is_beyond_the_limit():
    check = StampCheck('/camera')
    assert check.push(START, 'first') == []
    assert check.release() == [('first', None)]
    assert check.push(START + 60 * NS, 'after a pause') == []
    assert check.release() == [('after a pause', None)]
    assert check.push(FUTURE, 'far') == []
    assert check.release() == []
    # A slow camera whose clock was set: the next one agrees.
    assert check.push(FUTURE + 2 * NS, 'far too') == [('far', None), ('far too', None)]


def test_a_refusal_says_the_stamp_and_the_setting():
    *_, (_, refusal) = results([START, START + NS, FUTURE])
    assert f'impossible time stamp {FUTURE} ns, 13281 days from' in str(refusal)
    assert 'NANOROCKS_MAX_PAUSE_SECONDS' in str(refusal)
    *_, (_, refusal), _ = results([START, START + NS, START + 3600 * NS, START + 2 * NS])
    assert '3599 s from' in str(refusal)
    assert 'the clock of the camera' in str(refusal)
