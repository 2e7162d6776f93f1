"""Overrides of a quality of service: what is wrong with those that a node was given."""

from __future__ import annotations

import difflib

from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy

from nanorocks_ros.errors import ConfigurationError

PREFIX = 'qos_overrides.'
_ENTITIES = ('publisher', 'subscription')
_CHOICES = {
    'history': HistoryPolicy,
    'reliability': ReliabilityPolicy,
    'durability': DurabilityPolicy,
}
_POLICIES = (*_CHOICES, 'depth')
# What DDS can be told.
_DEEPEST = 2**31 - 1


def refuse_wrong_overrides(given):
    """Refuse what overrides no policy, or by no value that it can have.

    Parameters
    ----------
    given : mapping of str to rclpy.parameter.Parameter
        All parameters that a node was given.

    Raises
    ------
    ConfigurationError
    """
    for name, parameter in given.items():
        if name.startswith(PREFIX):
            _refuse(name, _wrong(name, parameter.value))


def refuse_unheard_overrides(given, declared, late):
    """Refuse what overrides a topic that a node does not have.

    Parameters
    ----------
    given : iterable of str
        Parameters, of which the overrides are none that `refuse_wrong_overrides` refuses.
    declared : collection of str
        Parameters that the node has.
    late : collection of str
        Full names of topics that it may publish or hear later.

    Raises
    ------
    ConfigurationError
        With the topic that comes nearest.
    """
    for name in sorted(given):
        if name.startswith(PREFIX) and name not in declared:
            topic, entity, _ = _parts(name)
            if topic not in late:
                _refuse(name, _unheard(topic, entity, declared))


def _refuse(name, problem):
    if problem is not None:
        raise ConfigurationError(f'parameter {name}', problem, 'see docs/reference/nodes.md')


def _parts(name):
    return name.removeprefix(PREFIX).rsplit('.', 2)


def _wrong(name, value):
    parts = _parts(name)
    if len(parts) < 3 or parts[1] not in _ENTITIES:
        return 'is not qos_overrides.TOPIC.publisher.POLICY or .subscription.POLICY'
    policy = parts[2]
    if policy not in _POLICIES:
        return f'no policy {policy!r}{_guess(policy, _POLICIES)}'
    if policy == 'depth':
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not 1 <= value <= _DEEPEST:
            return f'{value!r} is not a whole number from 1 to {_DEEPEST}'
        return None
    choices = [key for key in _CHOICES[policy].short_keys() if key != 'unknown']
    if not isinstance(value, str) or value.lower() not in choices:
        return f'{value!r} is none of {", ".join(choices)}'
    return None


def _unheard(topic, entity, declared):
    found = [_parts(one) for one in declared if one.startswith(PREFIX)]
    ours = {name for name, side, _ in found if side == entity}
    return f'this node has no {entity} of {topic}{_guess(topic, ours)}'


def _guess(name, known):
    near = difflib.get_close_matches(name, known, n=1)
    return f' (did you mean {near[0]!r}?)' if near else ''
