"""Warnings about the topics of a node: no publisher, several publishers, incompatible QoS."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from rclpy.clock import ROSClock

from nanorocks_ros.nodes.base.communication.qos_compatibility import mismatches
from nanorocks_ros.nodes.base.communication.ros_messages import node_name_of
from nanorocks_ros.nodes.base.problems import NO_PUBLISHER, Level, Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.clock import Clock
    from rclpy.node import Node

_PATIENCE_S = 5.0
ONE_SOURCE = 'stop all but one, or give each graph a namespace of its own (-r __ns:=/NAME)'
"""Remedy for results that two nodes publish."""
_ONE_CAMERA = 'stop all but one, or give each a namespace of its own (-r __ns:=/NAME)'
# A publisher is discovered before the node that it belongs to; so many checks wait for the name.
_UNKNOWN_NODE, _MAX_WAITS = '_NODE_NAME_UNKNOWN_', 5


class TopicMonitor:
    """Checks the topics of a node, and logs each problem once.

    Parameters
    ----------
    node : rclpy.node.Node
    clock : rclpy.clock.Clock
        That the checks are timed by.

    Attributes
    ----------
    required : list of str
        Topics that need a publisher.
    """

    def __init__(self, node: Node, clock: Clock) -> None:
        self._node = node
        self._clock = clock
        self._single: dict[str, str] = {}
        self._waits: Counter[str] = Counter()
        # Problems that were logged, while they last.
        self._several: dict[str, str] = {}
        self._wrong_types: dict[str, str] = {}
        self._types: dict[str, str] = {}
        self._incompatible: dict[str, str] = {}
        self.required: list[str] = []
        self._check_later(self._check_clock)

    def _check_later(self, check: Callable[[], None]) -> None:
        """Call a check once, after 5 s."""

        def check_once() -> None:
            timer.cancel()
            check()

        timer = self._node.create_timer(_PATIENCE_S, check_once, clock=self._clock)

    def _warn(self, text: str) -> None:
        self._node.get_logger().warning(text)

    def require_publisher(self, name: str) -> None:
        """Warn when nobody publishes a topic within 5 s."""
        self.required.append(name)
        self._check_later(lambda: self._check_publishers(name))

    def require_single_publisher(self, name: str, remedy: str = _ONE_CAMERA) -> None:
        """Warn when more than one node publishes a topic: their messages would be mixed."""
        self._single[name] = remedy

    def require_type(self, topic: str, type_name: str) -> None:
        """Tell when a topic that the node subscribes to is published with another type.

        Parameters
        ----------
        topic : str
            Full name.
        type_name : str
            Such as ``sensor_msgs/msg/Image``.
        """
        self._types[topic] = type_name

    def problems(self) -> list[Problem]:
        """What is wrong with the topics now.

        Wrong types, incompatible QoS, several publishers, and required topics that nobody
        publishes.
        """
        self._check_types()
        for topic in tuple(self._incompatible):
            self._check_qos(topic)
        self._check_single_publishers()
        missing = [name for name in self.required if self._node.count_publishers(name) == 0]
        return [
            *(Problem(Level.ERROR, text) for text in self._wrong_types.values()),
            *(Problem(Level.ERROR, text) for text in self._incompatible.values()),
            *(Problem(Level.WARN, text) for text in self._several.values()),
            *(
                [Problem(Level.WARN, f'no publisher on {", ".join(missing)}', NO_PUBLISHER)]
                if missing
                else []
            ),
        ]

    def _check_types(self) -> None:
        for topic, expected in self._types.items():
            if self._node.count_publishers(topic) == 0:
                self._wrong_types.pop(topic, None)
                continue
            wrong = [
                endpoint
                for endpoint in self._node.get_publishers_info_by_topic(topic)
                if endpoint.topic_type != expected
            ]
            if not wrong:
                self._wrong_types.pop(topic, None)
            elif topic not in self._wrong_types:
                published = wrong[0].topic_type
                text = (
                    f'{topic}: {node_name_of(wrong[0])} publishes {published}, this node takes '
                    f'{expected}, so that nothing arrives; remap the topic (-r {topic}:=/OTHER)'
                )
                if 'Image' in expected and 'Image' in published:
                    text += ', or set transport:=raw or transport:=compressed'
                self._wrong_types[topic] = text
                self._warn(text)

    def _check_single_publishers(self) -> None:
        for name, remedy in self._single.items():
            topic = self._node.resolve_topic_name(name)
            if self._node.count_publishers(topic) < 2:
                self._several.pop(name, None)
                continue
            if name in self._several:
                continue
            endpoints = self._node.get_publishers_info_by_topic(topic)
            unknown = any(endpoint.node_name == _UNKNOWN_NODE for endpoint in endpoints)
            if unknown and self._waits[name] < _MAX_WAITS:
                self._waits[name] += 1
                continue
            nodes = sorted(node_name_of(endpoint) for endpoint in endpoints)
            self._several[name] = (
                f'{topic}: published by {" and ".join(nodes)}, their messages are mixed; {remedy}'
            )
            self._warn(self._several[name])

    def report_incompatible_qos(self, name: str, _: Any) -> None:
        """Tell that a publisher offers less than this node requests; the middleware calls it."""
        self._check_qos(self._node.resolve_topic_name(name))

    def _check_qos(self, topic: str) -> None:
        """Note by which policies a topic does not match, with the remedy, until it does."""
        offered = [
            endpoint.qos_profile for endpoint in self._node.get_publishers_info_by_topic(topic)
        ]
        requested = [
            endpoint.qos_profile
            for endpoint in self._node.get_subscriptions_info_by_topic(topic)
            if endpoint.node_name == self._node.get_name()
        ]
        differing = mismatches(offered, requested)
        if not differing:
            self._incompatible.pop(topic, None)
            return
        differences = ', '.join(
            f'{mismatch.policy} {mismatch.offered} but this node requests {mismatch.requested}'
            for mismatch in differing
        )
        overrides = ' '.join(
            f'-p qos_overrides.{topic}.subscription.{mismatch.policy}:={mismatch.offered.lower()}'
            for mismatch in differing
        )
        text = f'{topic}: no data, the publisher offers {differences}; set {overrides}'
        if self._incompatible.get(topic) != text:
            self._incompatible[topic] = text
            self._warn(text)

    def _check_publishers(self, name: str) -> None:
        if self._node.count_publishers(name) == 0:
            self._warn(
                f'{name}: no publisher within {_PATIENCE_S:g} s; start one, remap the topic, or '
                'check the namespace and ROS_DOMAIN_ID'
            )

    def _check_clock(self) -> None:
        clock = self._node.get_clock()
        simulated = isinstance(clock, ROSClock) and clock.ros_time_is_active
        if simulated and clock.now().nanoseconds == 0:
            self._warn(
                f'/clock: no message within {_PATIENCE_S:g} s although use_sim_time is set, so '
                'time stands still; start bag_player (or ros2 bag play --clock), or set '
                'use_sim_time:=false'
            )
