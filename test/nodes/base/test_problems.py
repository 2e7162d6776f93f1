"""Problems are told while they last, with the seriousness that they have then."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes.base.problems import DiskSpace, Level, Losses, Problem, Refusals, Silence


class Clock:
    """Seconds that a test sets."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def test_refusals_are_an_error_then_a_warning_then_over(clock):
    refusals = Refusals(clock)
    assert refusals.problem() is None
    refusals.add('too dark')
    refusals.add('too bright')
    assert refusals.problem() == Problem(Level.ERROR, 'too bright')
    clock.now += 10.0
    later = refusals.problem()
    assert later.level is Level.WARN
    assert later.text == '2 messages refused so far, none for 10 s: too bright'
    clock.now += 30.0
    assert refusals.problem() is None
    refusals.add('too dark')
    assert refusals.problem().level is Level.ERROR


def test_a_silent_camera_is_a_warning_after_2_s_and_an_error_after_10(clock):
    silence = Silence('/camera', clock)
    levels = {}
    silence.hear()
    for seconds in (1.0, 1.9, 2.1, 9.9, 10.1):
        clock.now = 100.0 + seconds
        problem = silence.problem(publishers=1)
        levels[seconds] = problem and problem.level
    assert levels == {1.0: None, 1.9: None, 2.1: Level.WARN, 9.9: Level.WARN, 10.1: Level.ERROR}
    silence.hear()
    assert silence.problem(publishers=1) is None


def test_without_a_publisher_nobody_is_silent(clock):
    silence = Silence('/camera', clock)
    clock.now += 60.0
    assert silence.problem(publishers=0) is None
    assert silence.problem(publishers=1) is None
    clock.now += 3.0
    assert silence.problem(publishers=1).level is Level.WARN


def test_a_slow_camera_is_silent_later(clock):
    silence = Silence('/camera', clock)
    for _ in range(3):
        silence.hear()
        clock.now += 4.0
    assert silence.problem(publishers=1) is None
    clock.now += 9.0
    assert silence.problem(publishers=1).level is Level.ERROR


def test_losses_are_a_rate_of_the_last_ten_seconds(clock):
    losses = Losses(clock)
    for _ in range(4):
        losses.add(5)
        clock.now += 1.0
    assert losses.rate() == pytest.approx(2.0)
    clock.now += 8.5
    assert losses.rate() == pytest.approx(0.5)
    clock.now += 10.0
    assert losses.rate() == 0.0


def test_a_disk_is_low_by_its_space_and_by_the_time_until_it_is_full(clock):
    disk = DiskSpace('bags/run', clock)
    assert disk.problem(50_000_000_000) is None
    assert disk.problem(900_000_000).level is Level.WARN
    assert disk.problem(90_000_000).level is Level.ERROR
    filling = DiskSpace('bags/run', clock)
    assert filling.problem(40_000_000_000) is None
    clock.now += 30.0
    problem = filling.problem(20_000_000_000)
    assert (problem.level, problem.alarm) == (Level.ERROR, 'disk low')
    assert problem.text.startswith(
        'bags/run: 20.0 GB left on the disk, full in 30 s at this rate;'
    )
    clock.now += 30.0
    assert filling.problem(20_000_000_000) is None


def test_a_disk_of_which_others_free_space_is_not_low(clock):
    disk = DiskSpace('bags/run', clock)
    for free in (20_000_000_000, 30_000_000_000, 40_000_000_000):
        assert disk.problem(free) is None
        clock.now += 40.0
