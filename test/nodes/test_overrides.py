"""An override of a quality of service that does nothing, or cannot be, is refused."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes._overrides import refuse_unheard_overrides, refuse_wrong_overrides

RAW = '/nanorocks/camera/image_raw'
DECLARED = {f'qos_overrides.{RAW}.subscription.depth', 'qos_overrides./x.publisher.depth', 'rate'}


def refused(problem):
    return pytest.raises(ConfigurationError, match=re.escape(problem))


def give(name, value):
    refuse_wrong_overrides({'rate': None, name: SimpleNamespace(value=value)})


@pytest.mark.parametrize(
    ('policy', 'value'),
    [
        ('depth', 1),
        ('depth', 1000),
        ('reliability', 'best_effort'),
        ('reliability', 'RELIABLE'),
        ('durability', 'transient_local'),
        ('history', 'keep_all'),
    ],
)
def test_what_ros_takes_is_taken(policy, value):
    give(f'qos_overrides.{RAW}.publisher.{policy}', value)


@pytest.mark.parametrize(
    ('policy', 'value', 'problem'),
    [
        ('depth', -1, '-1 is not a whole number from 1 to'),
        ('depth', 0, '0 is not a whole number'),
        ('depth', 2**31, f'{2**31} is not a whole number'),
        ('depth', True, 'True is not a whole number'),
        ('depth', 1.5, '1.5 is not a whole number'),
        ('reliability', 'best_efort', "'best_efort' is none of system_default, reliable, best_ef"),
        ('reliability', 1, '1 is none of'),
        ('history', 'unknown', "'unknown' is none of"),
        ('reliabilty', 'reliable', "no policy 'reliabilty' (did you mean 'reliability'?)"),
        ('lifespan', 3, "no policy 'lifespan'"),
    ],
)
def test_what_is_no_policy_or_no_value_of_it_is_wrong(policy, value, problem):
    name = f'qos_overrides.{RAW}.subscription.{policy}'
    with refused(f'parameter {name}: {problem}'):
        give(name, value)


@pytest.mark.parametrize('rest', ['depth', f'{RAW}.depth', f'{RAW}.subscripton.depth'])
def test_what_names_no_topic_and_side_is_wrong(rest):
    with refused('is not qos_overrides.TOPIC.publisher.'):
        give(f'qos_overrides.{rest}', 3)


def test_a_topic_that_the_node_does_not_have_is_not_heard():
    def give(topic, entity='subscription'):
        given = {'rat', f'qos_overrides.{topic}.{entity}.depth'}
        refuse_unheard_overrides(given, DECLARED, {'/clock'})

    give(RAW)
    give('/clock')
    wrong = '/nanorocks/camera/imageraw'
    with refused(f'this node has no subscription of {wrong} (did you mean {RAW!r}?)'):
        give(wrong)
    with refused(f'this node has no publisher of {RAW}; see docs/reference/nodes.md'):
        give(RAW, 'publisher')
