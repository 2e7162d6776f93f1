"""Invalid rules are refused; the error names the value and the reason."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gases import BOX

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    PowerLawRestitution,
    UniformRestitution,
    ViscoelasticRestitution,
)
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

NAN, INF = math.nan, math.inf
MOTION = WallMotion(amplitude=(1, 0, 0), angular_frequency=1.0)


def motion(**change):
    return {'motion': WallMotion(**{'amplitude': (1, 0, 0), 'angular_frequency': 1.0, **change})}


def uniform(mean, width):
    return {'restitution': UniformRestitution(mean=mean, width=width)}


LAW = PowerLawRestitution(value=0.9, at_speed=1.0, exponent=0.2)


def power_law(value, exponent):
    return {'restitution': replace(LAW, value=value, exponent=exponent)}


def viscoelastic(value, at_speed):
    return {'restitution': ViscoelasticRestitution(value=value, at_speed=at_speed)}


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'box': (1, 0, 1)}, 'box: side_y is 0'),
        ({'box': (-1.0, 1, 1)}, 'box: side_x is -1.0'),
        ({'box': (1, 1, INF)}, 'box: side_z is inf'),
        ({'box': (1, NAN, 1)}, 'box: side_y is nan'),
        ({'box': (1, 1)}, 'box: 2 sides'),
        ({'periodic': (True, False)}, 'periodic: 2 axes'),
        ({'restitution': 1.01}, r'restitution: 1\.01 is outside \[0, 1\]; .* allow_gain=True'),
        ({'restitution': -0.1}, 'restitution: -0.1 is outside'),
        ({'restitution': NAN}, 'restitution: nan is outside'),
        ({'restitution': INF}, 'restitution: inf is outside'),
        ({'restitution': 'bouncy'}, 'restitution: .* give numbers from 0 to 1'),
        ({'restitution': None}, 'restitution: nan is outside'),
        ({'restitution': [[0.5, 0.6], [0.7, 0.5]]}, 'restitution: not a symmetric table'),
        ({'restitution': [[0.5, 0.6]]}, 'restitution: not a symmetric table'),
        ({'restitution': [0.5, 0.6]}, 'restitution: not a symmetric table'),
        ({'restitution': np.full((2, 2, 2), 0.5)}, 'restitution: not a symmetric table'),
        ({'restitution': [[0.5], [0.5, 0.6]]}, 'restitution: '),
        ({'restitution': [[0.5, 1.6], [1.6, 0.5]]}, 'restitution: 1.6 is outside'),
        ({'restitution': [[0.5, NAN], [NAN, 0.5]]}, 'restitution: nan is outside'),
        (uniform(0.9, 0.4), r'restitution: .* reaches from 0\.7 to 1\.1'),
        (uniform(0.1, 0.4), r'restitution: .* reaches from -0\.1 to 0\.3'),
        (uniform(0.5, -0.1), 'restitution: '),
        (uniform(NAN, 0.1), 'restitution: '),
        (uniform(0.5, NAN), 'restitution: '),
        (uniform(0.5, INF), 'restitution: '),
        (viscoelastic(1.0, 1.0), 'restitution: .* give a value between 0 and 1'),
        (viscoelastic(0.0, 1.0), 'restitution: .* give a value between 0 and 1'),
        (viscoelastic(NAN, 1.0), 'restitution: '),
        (viscoelastic(0.8, 0.0), 'restitution: .* at a positive speed'),
        (viscoelastic(0.8, INF), 'restitution: .* at a positive speed'),
        (viscoelastic(0.8, NAN), 'restitution: .* at a positive speed'),
        (power_law(1.1, 0.2), 'restitution: .* an exponent of 0 or more'),
        (power_law(0.8, -0.2), 'restitution: .* an exponent of 0 or more'),
        (power_law(0.8, INF), 'restitution: .* an exponent of 0 or more'),
        (power_law(NAN, 0.2), 'restitution: '),
        ({'wall_restitution': replace(LAW, value=1.2)}, 'wall_restitution: .* from 0 to 1'),
        ({'wall_restitution': [LAW, 0.9]}, 'wall_restitution: .* give all walls a law, or none'),
        ({'wall_restitution': [LAW, LAW]}, r'wall_restitution: shape \(2,\)'),
        (
            {'wall_restitution': [LAW] * 5 + [replace(LAW, exponent=0.3)]},
            'wall_restitution: .* laws that differ in their value',
        ),
        ({'wall_restitution': 2.0}, 'wall_restitution: 2.0 is outside'),
        ({'wall_restitution': (1, 1, 1, 1, 1, -1)}, 'wall_restitution: -1.0 is outside'),
        ({'wall_restitution': (1, 1, 1, 1, 1, NAN)}, 'wall_restitution: nan is outside'),
        ({'wall_restitution': (1, 1, 1)}, r'wall_restitution: shape \(3,\)'),
        ({'contact_duration': -1.0}, 'contact_duration: -1.0'),
        ({'contact_duration': NAN}, 'contact_duration: nan'),
        ({'contact_duration': INF}, 'contact_duration: inf'),
        ({'sticking_speed': -1.0}, 'sticking_speed: -1.0'),
        ({'sticking_speed': NAN}, 'sticking_speed: nan'),
        ({'sticking_speed': INF}, 'sticking_speed: inf'),
        ({'wall_sticking_speed': -1.0}, 'wall_sticking_speed: -1.0'),
        ({'wall_sticking_speed': NAN}, 'wall_sticking_speed: nan'),
        (
            {'sticking_measure': 'spin'},
            "sticking_measure: 'spin' is none of normal, total; give one of them",
        ),
        ({'wall_sticking_speed': 0.1, 'motion': MOTION}, 'bodies cannot stick to walls that move'),
        ({'tangential_restitution': 1.1}, 'tangential_restitution: 1.1 is outside'),
        ({'tangential_restitution': -1.1}, 'tangential_restitution: -1.1 is outside'),
        ({'tangential_restitution': NAN}, 'tangential_restitution: nan is outside'),
        ({'wall_tangential_restitution': 2.0}, 'wall_tangential_restitution: 2.0 is outside'),
        ({'wall_tangential_restitution': NAN}, 'wall_tangential_restitution: nan is outside'),
        ({'friction': -0.1}, 'friction: -0.1; give 0 or more'),
        ({'wall_friction': NAN}, 'wall_friction: nan; give 0 or more'),
        (motion(amplitude=(NAN, 0, 0)), 'motion: .* give finite amplitudes'),
        (motion(amplitude=(0, INF, 0)), 'motion: .* give finite amplitudes'),
        (motion(amplitude=(1, 0)), 'motion: .* give finite amplitudes'),
        (motion(angular_frequency=0.0), 'motion: .* a positive frequency'),
        (motion(angular_frequency=-1.0), 'motion: .* a positive frequency'),
        (motion(angular_frequency=NAN), 'motion: .* a positive frequency'),
        (motion(angular_frequency=INF), 'motion: .* a positive frequency'),
        (motion(damping=-1.0), 'motion: '),
        (motion(damping=NAN), 'motion: '),
        (motion(start=NAN), 'motion: '),
        (motion(start=-INF), 'motion: '),
        (motion(start=2.0, end=1.0), 'motion: .* start <= end'),
        (motion(end=NAN), 'motion: .* start <= end'),
        ({'seed': -1}, 'seed: root seed -1'),
    ],
)
def test_an_invalid_rule_is_refused_with_the_remedy(change, message):
    with pytest.raises(SimulationError, match=message):
        CollisionRules(**{'box': BOX, **change})


@pytest.mark.parametrize(
    'change',
    [
        {'restitution': 1.5},
        {'restitution': [[1.0, 1.2], [1.2, 1.0]]},
        {'wall_restitution': (1, 1, 1, 1, 1, 1.1)},
        uniform(1.0, 0.2),
    ],
)
def test_a_restitution_above_one_is_accepted_when_gain_is_allowed(change):
    with pytest.raises(SimulationError, match='restitution'):
        CollisionRules(box=BOX, **change)
    CollisionRules(box=BOX, allow_gain=True, **change)


@pytest.mark.parametrize(
    'change',
    [
        {'restitution': INF},
        {'restitution': -0.5},
        {'restitution': NAN},
        {'wall_restitution': INF},
        uniform(INF, 0.0),
        uniform(NAN, 0.0),
    ],
)
def test_gain_still_refuses_values_that_are_no_restitution(change):
    with pytest.raises(SimulationError, match='restitution'):
        CollisionRules(box=BOX, allow_gain=True, **change)


@pytest.mark.parametrize(
    'make',
    [
        lambda: WallMotion.sinusoidal((1, 0, 0), 0.0, 3),
        lambda: WallMotion.sinusoidal((1, 0, 0), -1.0, 3),
        lambda: WallMotion.impulsive((1, 0, 0), 0.0, 1.0),
        lambda: WallMotion.impulsive((1, 0, 0), 1.0, NAN),
        lambda: WallMotion.impulsive((1, 0, 0), 1.0, -1.0),
    ],
)
def test_a_swing_without_a_frequency_or_with_negative_damping_is_refused(make):
    with pytest.raises(SimulationError):
        CollisionRules(box=BOX, motion=make())


def test_rules_at_the_limits_of_their_ranges_are_accepted():
    for value in (0.0, 1.0):
        CollisionRules(box=BOX, restitution=value, wall_restitution=value)
    for value in (-1.0, 1.0):
        CollisionRules(box=BOX, tangential_restitution=value, wall_tangential_restitution=value)
    CollisionRules(box=BOX, contact_duration=0.0, sticking_speed=0.0, **uniform(0.5, 1.0))
