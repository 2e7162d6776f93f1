"""The time of a recording runs with a clock at its rate, is held, and goes back."""

from __future__ import annotations

import pytest

from nanorocks_ros.nodes._pace import Pace

NS = 10**9


class Clock:
    """A clock that goes on when it is told to."""

    def __init__(self):
        self.seconds = 1000.0

    def __call__(self):
        return self.seconds


def running(rate, clock, position=0.0):
    pace = Pace(rate, clock)
    pace.go_to(round(position * NS))
    pace.run()
    return pace


def played(pace, clock, stamps):
    """When each moment comes, in seconds of the clock."""
    begin, found = clock.seconds, []
    for stamp in stamps:
        pace.next_ns = round(stamp * NS)
        clock.seconds += pace.wait_s()
        assert pace.wait_s() == 0.0
        pace.reached(pace.next_ns)
        found.append(clock.seconds - begin)
    return found


@pytest.mark.parametrize('rate', [0.5, 1.0, 4.0])
@pytest.mark.parametrize('mark', [(), (5.0,)])
def test_every_turn_of_a_loop_is_played_at_the_rate(rate, mark):
    """With a moment that marks the turn, as the player has it, or without."""
    clock = Clock()
    turn = (5.0, 6.0, 8.0)
    found = played(running(rate, clock, 5.0), clock, [*turn, *mark, *turn, *mark, *turn])
    first = [0.0, 1.0, 3.0]
    once = [3.0] * len(mark)
    seconds = [*first, *once, *(3.0 + one for one in first), *(2 * one for one in once)]
    seconds += [6.0 + one for one in first]
    assert found == pytest.approx([one / rate for one in seconds])


def test_what_is_late_is_made_up_for():
    clock = Clock()
    pace = running(1.0, clock)
    clock.seconds += 2.5
    assert played(pace, clock, [0.0, 1.0, 2.0, 3.0]) == pytest.approx([0.0, 0.0, 0.0, 0.5])


def test_held_time_stands_still_and_goes_on_where_it_stood():
    clock = Clock()
    pace = running(2.0, clock)
    played(pace, clock, [0.0])
    pace.next_ns = 10 * NS
    clock.seconds += 1.0
    pace.hold()
    assert pace.now_ns == 2 * NS
    clock.seconds += 100.0
    assert pace.now_ns == 2 * NS
    pace.hold()
    pace.run()
    assert pace.wait_s() == pytest.approx(4.0)
    clock.seconds += 1.0
    assert pace.now_ns == 4 * NS


def test_a_moment_that_comes_while_time_is_held_moves_it_and_no_more():
    clock = Clock()
    pace = running(1.0, clock, 3.0)
    pace.hold()
    for stamp in (4, 6, 3):
        pace.next_ns = stamp * NS
        pace.reached(stamp * NS)
        clock.seconds += 10.0
        assert pace.now_ns == stamp * NS
    pace.run()
    assert played(pace, clock, [5.0]) == pytest.approx([2.0])


def test_time_does_not_run_past_what_is_still_to_come():
    clock = Clock()
    pace = running(1.0, clock)
    pace.next_ns = 3 * NS
    clock.seconds += 10.0
    assert pace.now_ns == 3 * NS


def test_near_the_end_of_a_turn_time_does_not_run_back_before_the_next():
    clock = Clock()
    pace = running(1.0, clock, 5.0)
    played(pace, clock, [5.0, 8.0])
    pace.next_ns = 5 * NS
    assert pace.now_ns == 8 * NS
    pace.next_ns = None
    assert pace.now_ns == 8 * NS


def test_after_a_jump_the_next_moment_is_waited_for_from_there():
    clock = Clock()
    pace = running(1.0, clock)
    played(pace, clock, [0.0, 20.0])
    pace.go_to(2 * NS)
    assert pace.now_ns == 2 * NS
    assert played(pace, clock, [5.0]) == pytest.approx([3.0])


def test_another_rate_holds_from_now_on():
    clock = Clock()
    pace = running(1.0, clock)
    pace.next_ns = 10 * NS
    clock.seconds += 4.0
    pace.set_rate(0.5)
    clock.seconds += 2.0
    assert pace.now_ns == 5 * NS
    assert pace.wait_s() == pytest.approx(10.0)


def test_at_rate_0_time_moves_with_the_moments():
    clock = Clock()
    pace = running(0.0, clock)
    for stamp in (0, 7, 3):
        pace.next_ns = stamp * NS
        clock.seconds += 1.0
        pace.reached(stamp * NS)
        assert pace.now_ns == stamp * NS
