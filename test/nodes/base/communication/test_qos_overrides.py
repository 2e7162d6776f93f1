"""QoS overrides that are invalid, or of topics that a node does not have, are refused."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes.base.communication.qos_overrides import (
    refuse_invalid_overrides,
    refuse_overrides_of_unknown_topics,
)

RAW = '/nanorocks/camera/image_raw'
DECLARED = {f'qos_overrides.{RAW}.subscription.depth', 'qos_overrides./x.publisher.depth', 'rate'}


def refused(problem):
    return pytest.raises(ConfigurationError, match=re.escape(problem))


def give(name, value):
    refuse_invalid_overrides({'rate': None, name: SimpleNamespace(value=value)})


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
def test_valid_overrides_are_accepted(policy, value):
    give(f'qos_overrides.{RAW}.publisher.{policy}', value)


@pytest.mark.parametrize(
    ('policy', 'value', 'problem'),
    [
        ('depth', -1, '-1 is not a whole number from 1 to'),
        ('depth', 0, '0 is not a whole number'),
        ('depth', 2**31, f'{2**31} is not a whole number'),
        ('depth', True, 'True is not a whole number'),
        ('depth', 1.5, '1.5 is not a whole number'),
        ('reliability', 'best_efort', "'best_efort' is not one of system_default, reliable, "),
        ('reliability', 1, '1 is not one of'),
        ('history', 'unknown', "'unknown' is not one of"),
        (
            'reliabilty',
            'reliable',
            "unknown policy 'reliabilty' (did you mean reliability or durability?)",
        ),
        ('lifespan', 3, "unknown policy 'lifespan'"),
    ],
)
def test_unknown_policies_and_values_are_refused(policy, value, problem):
    name = f'qos_overrides.{RAW}.subscription.{policy}'
    with refused(f'parameter {name}: {problem}'):
        give(name, value)


@pytest.mark.parametrize('rest', ['depth', f'{RAW}.depth', f'{RAW}.subscripton.depth'])
def test_an_override_without_topic_or_entity_is_refused(rest):
    with refused('is not qos_overrides.TOPIC.publisher.'):
        give(f'qos_overrides.{rest}', 3)


def test_a_topic_that_the_node_does_not_have_is_refused():
    def give(topic, entity='subscription'):
        given = {'rat', f'qos_overrides.{topic}.{entity}.depth'}
        refuse_overrides_of_unknown_topics(given, DECLARED, {'/clock'})

    give(RAW)
    give('/clock')
    wrong = '/nanorocks/camera/imageraw'
    with refused(f'this node has no subscription on {wrong} (did you mean {RAW}'):
        give(wrong)
    with refused(f'this node has no publisher on {RAW}; name a topic as'):
        give(RAW, 'publisher')
