"""One far-future stamp is an impossible stamp, not billions of lost frames."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.errors import FrameError
from nanorocks_ros.records import NS, Frame
from nanorocks_ros.studies.analysis.impossible_stamps import with_possible_stamps

START, FUTURE = 1_000_000_000 * NS, (2**31 - 1) * NS


def checked(stamps):
    """The stamps that are kept; None in the place of a refused frame."""
    frames = [
        Frame(stamp_ns=s, encoding='mono8', image=np.zeros((1, 1), np.uint8)) for s in stamps
    ]
    results = list(with_possible_stamps(frames, 'bag: /camera'))
    return [None if isinstance(frame, FrameError) else frame.stamp_ns for frame in results]


@given(length=st.integers(3, 12), data=st.data())
def test_a_single_far_stamp_is_refused_wherever_it_is(length, data):
    stamps = [START + number * NS // 30 for number in range(length)]
    place = data.draw(st.integers(0, length - 1))
    far = data.draw(st.sampled_from([FUTURE, 1, START + 40 * 86_400 * NS]))
    changed = [*stamps[:place], far, *stamps[place + 1 :]]
    assert checked(changed) == [None if k == place else s for k, s in enumerate(stamps)]


def test_a_clock_that_was_set_is_kept():
    stamps = [1 * NS, 2 * NS, START, START + NS, START + 2 * NS]
    assert checked(stamps) == stamps


def test_a_long_pause_is_kept_by_its_limit(monkeypatch):
    stamps = [START, START + NS, START + 60 * 86_400 * NS]
    assert checked(stamps)[-1] is None
    monkeypatch.setenv('NANOROCKS_MAX_PAUSE_SECONDS', str(61 * 86_400))
    assert checked(stamps) == stamps


@pytest.mark.parametrize('count', [0, 1, 2])
def test_few_frames_have_no_neighbours_to_judge_by(count):
    stamps = [FUTURE + number for number in range(count)]
    assert checked(stamps) == stamps


def test_a_refusal_says_the_stamp_and_the_setting():
    frames = [
        Frame(stamp_ns=s, encoding='mono8', image=np.zeros((1, 1), np.uint8))
        for s in (START, START + NS, FUTURE)
    ]
    *_, refusal = with_possible_stamps(frames, 'bag: /camera')
    assert f'impossible time stamp {FUTURE} ns' in str(refusal)
    assert 'NANOROCKS_MAX_PAUSE_SECONDS' in str(refusal)
