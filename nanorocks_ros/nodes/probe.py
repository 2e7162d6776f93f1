"""Checks of ROS for ``nanorocks doctor``, in a process of its own; answers are JSON lines.

``python -m nanorocks_ros.nodes.probe import`` tells what is imported, ``receive TOPIC COUNT``
and ``send TOPIC COUNT`` count frames, ``graph SECONDS`` lists nodes and topics of the graph.
"""

from __future__ import annotations

import json
import os
import sys
import time
from functools import partial
from typing import TYPE_CHECKING, Any

from nanorocks_ros.nodes.run import NODES, use_large_segments

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.node import Node
    from rclpy.topic_endpoint_info import TopicEndpointInfo

Answer = dict[str, Any]
"""What is printed as JSON."""

_ROWS, _COLUMNS = 1080, 1920
_DEADLINE_S = 15.0
_STEP_S = 0.05
# Reports that may wait: of all nodes of a graph, once a second.
_REPORTS = 50


def _import_ros() -> Answer:
    import rclpy

    rclpy.init(args=[])
    import diagnostic_msgs.msg
    import sensor_msgs.msg
    import std_msgs.msg

    from nanorocks_ros.nodes.base.communication.typed_messages import typed_problem

    packages = (rclpy, diagnostic_msgs, sensor_msgs, std_msgs)
    rclpy.shutdown()
    return {
        'rmw': rclpy.get_rmw_implementation_identifier(),
        'where': os.path.dirname(str(packages[0].__file__)),
        'executables': NODES,
        'typed': typed_problem(),
    }


def _receive(topic: str, count: int) -> Answer:
    """Count frames until all have arrived, or the deadline has passed."""
    from rclpy.node import Node

    from nanorocks_ros.nodes.base.communication.ros_messages import message_class, qos_of
    from nanorocks_ros.wire import topics

    node = Node('doctor_receiver')
    sizes: list[int] = []
    arrivals: list[float] = []

    def receive(message: Any) -> None:
        arrivals.append(time.monotonic())
        sizes.append(len(message.data))

    node.create_subscription(message_class(topics.RAW.type), topic, receive, qos_of(topics.RAW))
    print('ready', flush=True)
    _spin_until(node, lambda: len(sizes) >= count)
    seconds = time.monotonic() - arrivals[0] if arrivals else 0.0
    return {'received': len(sizes), 'bytes': sum(sizes), 'seconds': seconds}


def _send(topic: str, count: int) -> Answer:
    """Send frames, once somebody subscribes."""
    import numpy as np
    from rclpy.duration import Duration
    from rclpy.node import Node

    from nanorocks_ros.nodes.base.communication.ros_messages import (
        image_message,
        message_class,
        qos_of,
    )
    from nanorocks_ros.wire import topics

    node = Node('doctor_sender')
    publisher = node.create_publisher(message_class(topics.RAW.type), topic, qos_of(topics.RAW))
    _spin_until(node, lambda: publisher.get_subscription_count() > 0)
    sent = count if publisher.get_subscription_count() > 0 else 0
    pixels = np.zeros((_ROWS, _COLUMNS, 3), dtype=np.uint8)
    for number in range(sent):
        publisher.publish(image_message(number, 'doctor', pixels))
    publisher.wait_for_all_acked(Duration(seconds=_DEADLINE_S))
    return {'sent': sent, 'frame_bytes': pixels.nbytes}


def _spin_until(node: Node, condition: Callable[[], bool]) -> None:
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + _DEADLINE_S
    while not condition() and time.monotonic() < end:
        executor.spin_once(timeout_sec=_STEP_S)


def _list_topics(seconds: float) -> Answer:
    """What the nodes say of themselves, and every topic, with the pairs that do not match."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.node import Node

    node = Node('doctor')
    reports: dict[str, Answer] = {}
    node.create_subscription(
        DiagnosticArray, '/diagnostics', partial(_note_reports, reports), _REPORTS
    )
    # Names and endpoints are discovered with a heartbeat, every 3 s.
    end = time.monotonic() + seconds
    _spin_until(node, lambda: time.monotonic() > end)
    listed = []
    for name, types in sorted(node.get_topic_names_and_types()):
        publishers = _of_others(node, node.get_publishers_info_by_topic(name))
        subscriptions = _of_others(node, node.get_subscriptions_info_by_topic(name))
        if publishers or subscriptions:
            listed.append(
                {
                    'name': name,
                    'types': types,
                    'publishers': [_describe(endpoint) for endpoint in publishers],
                    'subscriptions': [_describe(endpoint) for endpoint in subscriptions],
                    'mismatches': _mismatches(publishers, subscriptions),
                }
            )
    return {
        'topics': listed,
        'reports': [reports[name] for name in sorted(reports)],
        'executables': NODES,
    }


def _note_reports(reports: dict[str, Answer], message: DiagnosticArray) -> None:
    """Keep the last report of each node of this package."""
    for status in message.status:
        if status.hardware_id == 'nanorocks':
            reports[status.name] = {
                'node': status.name,
                'level': int.from_bytes(status.level, 'little'),
                'message': status.message,
                'further': [
                    pair.value for pair in status.values if pair.key.startswith('problem ')
                ],
            }


def _of_others(node: Node, endpoints: Sequence[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
    return [endpoint for endpoint in endpoints if endpoint.node_name != node.get_name()]


def _describe(endpoint: TopicEndpointInfo) -> Answer:
    from nanorocks_ros.nodes.base.communication.ros_messages import node_name_of

    profile = endpoint.qos_profile
    return {
        'node': node_name_of(endpoint),
        'reliability': profile.reliability.name.lower(),
        'durability': profile.durability.name.lower(),
    }


def _mismatches(
    publishers: Sequence[TopicEndpointInfo], subscriptions: Sequence[TopicEndpointInfo]
) -> list[Answer]:
    """Publisher, subscription and reason of each pair that does not match."""
    from nanorocks_ros.nodes.base.communication.ros_messages import node_name_of

    pairs = []
    for publisher in publishers:
        for subscription in subscriptions:
            differing = publisher.topic_type != subscription.topic_type
            reason = _mismatch(publisher, subscription)
            if reason is not None:
                pairs.append(
                    {
                        'publisher': node_name_of(publisher),
                        'subscription': node_name_of(subscription),
                        'reason': reason,
                        'of_types': differing,
                        'offered': _offered(publisher, subscription),
                    }
                )
    return pairs


def _offered(publisher: TopicEndpointInfo, subscription: TopicEndpointInfo) -> dict[str, str]:
    """What a subscription would have to request, by policy."""
    from nanorocks_ros.nodes.base.communication.qos_compatibility import mismatches

    pairs = mismatches([publisher.qos_profile], [subscription.qos_profile])
    return {pair.policy: pair.offered.lower() for pair in pairs}


def _mismatch(publisher: TopicEndpointInfo, subscription: TopicEndpointInfo) -> str | None:
    """Why no message gets from one to the other; None when it does."""
    from rclpy.qos import QoSCompatibility, qos_check_compatible

    if publisher.topic_type != subscription.topic_type:
        return f'the types differ: {publisher.topic_type}, {subscription.topic_type}'
    compatibility, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
    # A new object every time: `is` would never hold.
    if compatibility != QoSCompatibility.ERROR:
        return None
    return str(reason).strip()


_TASKS: dict[str, Callable[..., Answer]] = {
    'receive': lambda topic, count: _receive(topic, int(count)),
    'send': lambda topic, count: _send(topic, int(count)),
    'graph': lambda seconds: _list_topics(float(seconds)),
}


def main(arguments: Sequence[str]) -> None:
    """Do a task, and print the answer."""
    task, *rest = arguments
    if task == 'import':
        print(json.dumps(_import_ros()))
        return
    use_large_segments()
    import rclpy

    rclpy.init(args=[])
    try:
        print(json.dumps(_TASKS[task](*rest)))
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main(sys.argv[1:])
