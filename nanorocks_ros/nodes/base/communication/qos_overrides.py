"""Checks of the parameters ``qos_overrides.TOPIC.publisher.POLICY`` that a node was given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy

from nanorocks_ros.errors import ConfigurationError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from rclpy.parameter import Parameter

PREFIX = 'qos_overrides.'
_ENTITIES = ('publisher', 'subscription')
_CHOICES: dict[str, Any] = {
    'history': HistoryPolicy,
    'reliability': ReliabilityPolicy,
    'durability': DurabilityPolicy,
}
_REMEDY = (
    'name a topic as `ros2 node info` does, and a policy of '
    'history, depth, reliability and durability'
)
_POLICIES = (*_CHOICES, 'depth')
# The largest depth that DDS accepts.
_MAX_DEPTH = 2**31 - 1


def refuse_invalid_overrides(given: Mapping[str, Parameter]) -> None:
    """Refuse overrides with an unknown policy, or with a value that the policy cannot have.

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
            _refuse(name, _problem(name, parameter.value))


def refuse_overrides_of_unknown_topics(
    given: Iterable[str], declared: Collection[str], later_topics: Collection[str]
) -> None:
    """Refuse overrides of topics that a node neither publishes nor subscribes to.

    Parameters
    ----------
    given : iterable of str
        Names of parameters; `refuse_invalid_overrides` has passed the overrides among them.
    declared : collection of str
        Names of the parameters that the node has.
    later_topics : collection of str
        Full names of topics that the node may publish or subscribe to later.

    Raises
    ------
    ConfigurationError
        With the topic that comes nearest.
    """
    for name in sorted(given):
        if name.startswith(PREFIX) and name not in declared:
            topic, entity, _ = _parts(name)
            if topic not in later_topics:
                _refuse(name, _unknown_topic(topic, entity, declared))


def _refuse(name: str, problem: str | None) -> None:
    if problem is not None:
        raise ConfigurationError(f'parameter {name}', problem, _REMEDY)


def _parts(name: str) -> list[str]:
    """Topic, entity and policy of an override."""
    return name.removeprefix(PREFIX).rsplit('.', 2)


def _problem(name: str, value: Any) -> str | None:
    parts = _parts(name)
    if len(parts) < 3 or parts[1] not in _ENTITIES:
        return 'is not qos_overrides.TOPIC.publisher.POLICY or .subscription.POLICY'
    policy = parts[2]
    if policy not in _POLICIES:
        return f'unknown policy {policy!r}{_suggestion(policy, _POLICIES)}'
    if policy == 'depth':
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not 1 <= value <= _MAX_DEPTH:
            return f'{value!r} is not a whole number from 1 to {_MAX_DEPTH}'
        return None
    choices = [key for key in _CHOICES[policy].short_keys() if key != 'unknown']
    if not isinstance(value, str) or value.lower() not in choices:
        return f'{value!r} is not one of {", ".join(choices)}'
    return None


def _unknown_topic(topic: str, entity: str, declared: Iterable[str]) -> str:
    overridable = [_parts(name) for name in declared if name.startswith(PREFIX)]
    topics = {name for name, kind, _ in overridable if kind == entity}
    return f'this node has no {entity} on {topic}{_suggestion(topic, topics)}'


def _suggestion(name: str, candidates: Collection[str]) -> str:
    hint = did_you_mean(name, candidates)
    return f' ({hint})' if hint else ''
