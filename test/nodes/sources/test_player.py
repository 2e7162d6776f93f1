"""The player emits every moment in order, pauses, steps and seeks."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes.sources.player import Player
from nanorocks_ros.settings import PacingSettings

NS = 10**9


@pytest.fixture
def play(own_node):
    """Make a player of numbers, one a second; the numbers that it emits; a function to spin."""
    node, spin_until = own_node

    def make(count, *, first=0, **pacing):
        emitted, ended = [], []
        player = Player(
            node,
            moments(first, count),
            lambda stamp_ns, number: emitted.append((stamp_ns, number)),
            PacingSettings(**pacing),
            lambda: ended.append(True),
        )
        return player, emitted, ended, spin_until

    return make


def moments(first, last):
    return ((number * NS, number) for number in range(first, last))


def numbered(first, last):
    return list(moments(first, last))


def test_all_moments_are_emitted_in_order_and_the_end_is_noted_once(play):
    _, emitted, ended, spin_until = play(5, rate=50.0)
    spin_until(lambda: bool(ended))
    assert emitted == numbered(0, 5)
    assert ended == [True]


def test_without_listeners_rate_0_plays_as_fast_as_possible(play):
    _, emitted, ended, spin_until = play(200, rate=0.0)
    spin_until(lambda: bool(ended))
    assert emitted == numbered(0, 200)


def test_the_duration_ends_the_playback(play):
    _, emitted, ended, spin_until = play(10, first=3, rate=0.0, duration=4.0)
    spin_until(lambda: bool(ended))
    assert emitted == numbered(3, 7)


def test_a_paused_player_steps_and_seeks(play):
    player, emitted, ended, spin_until = play(10, rate=20.0)
    player.pause()
    assert player.step(lambda number: number == 2)
    assert emitted == numbered(0, 3)
    assert player.now_ns == 2 * NS
    player.seek(moments(7, 10), 6 * NS)
    assert player.now_ns == 6 * NS
    assert not ended
    player.resume()
    spin_until(lambda: bool(ended))
    assert emitted == numbered(0, 3) + numbered(7, 10)
    assert not player.step(lambda _: True)
