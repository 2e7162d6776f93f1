"""The time of a recording runs at its rate, is paused, and goes back."""

from __future__ import annotations

import pytest

from nanorocks_ros.nodes.sources.playback_clock import PlaybackClock

NS = 10**9


class SteadyClock:
    """A clock that a test sets."""

    def __init__(self):
        self.seconds = 1000.0

    def __call__(self):
        return self.seconds


def running(rate, steady, position=0.0):
    playback = PlaybackClock(rate, steady)
    playback.seek(round(position * NS))
    playback.resume()
    return playback


def played(playback, steady, stamps):
    """When each moment comes, in seconds of the clock."""
    begin, times = steady.seconds, []
    for stamp in stamps:
        playback.next_ns = round(stamp * NS)
        steady.seconds += playback.seconds_until_next()
        assert playback.seconds_until_next() == 0.0
        playback.advance(playback.next_ns)
        times.append(steady.seconds - begin)
    return times


@pytest.mark.parametrize('rate', [0.5, 1.0, 4.0])
@pytest.mark.parametrize('mark', [(), (5.0,)])
def test_every_pass_of_a_loop_is_played_at_the_rate(rate, mark):
    """With a moment that marks a new pass, as the bag player emits it, or without."""
    steady = SteadyClock()
    stamps = (5.0, 6.0, 8.0)
    times = played(running(rate, steady, 5.0), steady, [*stamps, *mark, *stamps, *mark, *stamps])
    first = [0.0, 1.0, 3.0]
    once = [3.0] * len(mark)
    seconds = [*first, *once, *(3.0 + time for time in first), *(2 * time for time in once)]
    seconds += [6.0 + time for time in first]
    assert times == pytest.approx([second / rate for second in seconds])


def test_what_is_late_is_made_up_for():
    steady = SteadyClock()
    playback = running(1.0, steady)
    steady.seconds += 2.5
    assert played(playback, steady, [0.0, 1.0, 2.0, 3.0]) == pytest.approx([0.0, 0.0, 0.0, 0.5])


def test_held_time_stands_still_and_goes_on_where_it_stood():
    steady = SteadyClock()
    playback = running(2.0, steady)
    played(playback, steady, [0.0])
    playback.next_ns = 10 * NS
    steady.seconds += 1.0
    playback.pause()
    assert playback.now_ns == 2 * NS
    steady.seconds += 100.0
    assert playback.now_ns == 2 * NS
    playback.pause()
    playback.resume()
    assert playback.seconds_until_next() == pytest.approx(4.0)
    steady.seconds += 1.0
    assert playback.now_ns == 4 * NS


def test_a_moment_that_comes_while_time_is_held_moves_it_and_no_more():
    steady = SteadyClock()
    playback = running(1.0, steady, 3.0)
    playback.pause()
    for stamp in (4, 6, 3):
        playback.next_ns = stamp * NS
        playback.advance(stamp * NS)
        steady.seconds += 10.0
        assert playback.now_ns == stamp * NS
    playback.resume()
    assert played(playback, steady, [5.0]) == pytest.approx([2.0])


def test_time_does_not_run_past_what_is_still_to_come():
    steady = SteadyClock()
    playback = running(1.0, steady)
    playback.next_ns = 3 * NS
    steady.seconds += 10.0
    assert playback.now_ns == 3 * NS


def test_near_the_end_of_a_turn_time_does_not_run_back_before_the_next():
    steady = SteadyClock()
    playback = running(1.0, steady, 5.0)
    played(playback, steady, [5.0, 8.0])
    playback.next_ns = 5 * NS
    assert playback.now_ns == 8 * NS
    playback.next_ns = None
    assert playback.now_ns == 8 * NS


def test_after_a_jump_the_next_moment_is_waited_for_from_there():
    steady = SteadyClock()
    playback = running(1.0, steady)
    played(playback, steady, [0.0, 20.0])
    playback.seek(2 * NS)
    assert playback.now_ns == 2 * NS
    assert played(playback, steady, [5.0]) == pytest.approx([3.0])


def test_another_rate_holds_from_now_on():
    steady = SteadyClock()
    playback = running(1.0, steady)
    playback.next_ns = 10 * NS
    steady.seconds += 4.0
    playback.set_rate(0.5)
    steady.seconds += 2.0
    assert playback.now_ns == 5 * NS
    assert playback.seconds_until_next() == pytest.approx(10.0)


def test_at_rate_0_time_moves_with_the_moments():
    steady = SteadyClock()
    playback = running(0.0, steady)
    for stamp in (0, 7, 3):
        playback.next_ns = stamp * NS
        steady.seconds += 1.0
        playback.advance(stamp * NS)
        assert playback.now_ns == stamp * NS
