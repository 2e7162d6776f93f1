"""Rules of sticking are checked, with the value and a remedy."""

from __future__ import annotations

import pytest

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

BOX = (10.0, 10.0, 10.0)


@pytest.mark.parametrize(
    ('rules', 'message'),
    [
        ({'sticking_speed_width': -0.1}, 'sticking_speed_width: -0.1; give 0'),
        (
            {'sticking_speed': 0.1, 'sticking_speed_width': 0.3},
            'sticking_speed_width: 0.3 m/s around 0.1 m/s; give at most twice .*, 0.2',
        ),
        (
            {'aggregate_motion': 'spinning'},
            "aggregate_motion: 'spinning' is none of rotating, translating; give one of them",
        ),
        ({'break_up_speed': -1.0}, 'break_up_speed: -1.0'),
        ({'break_up_speed': 1.0}, 'break_up_speed: only bodies that turn break up; set'),
        (
            {'break_up_speed': 1.0, 'sticking_speed': 0.1, 'aggregate_motion': 'translating'},
            'break_up_speed: only bodies that turn',
        ),
        (
            {'sticking_speed': 0.2, 'sticking_speed_width': 0.2, 'break_up_speed': 0.3},
            'break_up_speed: 0.3 m/s, but contacts of up to 0.3 m/s stick; give more',
        ),
        (
            {'sticking_speed': 0.2, 'tangential_restitution': 0.5},
            'tangential_restitution: .* smooth; set aggregate_motion to translating',
        ),
        (
            {'sticking_speed': 0.2, 'periodic': (True, False, False)},
            'periodic: bodies cannot turn .*; set aggregate_motion to translating',
        ),
    ],
)
def test_rules_of_sticking_that_cannot_be_are_refused(rules, message):
    with pytest.raises(SimulationError, match=message):
        CollisionRules(box=BOX, **rules)


def test_bodies_turn_only_where_beads_stick_to_beads():
    assert not CollisionRules(box=BOX).compiled().rotating
    assert not CollisionRules(box=BOX, wall_sticking_speed=0.1).compiled().rotating
    assert CollisionRules(box=BOX, sticking_speed=0.1).compiled().rotating
    apart = CollisionRules(box=BOX, sticking_speed=0.1, aggregate_motion='translating')
    assert not apart.compiled().rotating


def test_rough_beads_and_periodic_sides_may_stick_where_bodies_do_not_turn():
    rules = CollisionRules(
        box=BOX,
        periodic=(True, True, True),
        sticking_speed=0.1,
        tangential_restitution=0.5,
        aggregate_motion='translating',
    )
    assert rules.compiled().sticky
