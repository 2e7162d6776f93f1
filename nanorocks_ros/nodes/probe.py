"""What ``nanorocks doctor`` asks of ROS, in a process of its own; answers are JSON lines.

``python -m nanorocks_ros.nodes.probe import`` tells what was imported, ``receive TOPIC COUNT``
and ``send TOPIC COUNT`` count frames, ``graph SECONDS`` lists who hears whom.
"""

from __future__ import annotations

import json
import os
import sys
import time

from nanorocks_ros.nodes._run import NODES, use_large_segments

_ROWS, _COLUMNS = 1080, 1920
_DEADLINE_S = 15.0
_STEP_S = 0.05


def _imported():
    import rclpy

    rclpy.init(args=[])
    import diagnostic_msgs.msg
    import sensor_msgs.msg
    import std_msgs.msg

    packages = (rclpy, diagnostic_msgs, sensor_msgs, std_msgs)
    rclpy.shutdown()
    return {
        'rmw': rclpy.get_rmw_implementation_identifier(),
        'where': os.path.dirname(packages[0].__file__),
        'executables': NODES,
    }


def _received(topic, count):
    """Count the frames that come until all did, or none came for long."""
    from rclpy.node import Node

    from nanorocks_ros.nodes._shell import message_class, qos_of
    from nanorocks_ros.wire import topics

    node = Node('doctor_receiver')
    sizes, begun = [], []

    def take(message):
        begun[:] = begun or [time.monotonic()]
        sizes.append(len(message.data))

    node.create_subscription(message_class(topics.RAW.type), topic, take, qos_of(topics.RAW))
    print('ready', flush=True)
    _spin(node, lambda: len(sizes) >= count)
    seconds = time.monotonic() - begun[0] if begun else 0.0
    return {'received': len(sizes), 'bytes': sum(sizes), 'seconds': seconds}


def _sent(topic, count):
    """Send frames, once somebody listens."""
    import numpy as np
    from rclpy.duration import Duration
    from rclpy.node import Node

    from nanorocks_ros.nodes._shell import image_message, message_class, qos_of
    from nanorocks_ros.wire import topics

    node = Node('doctor_sender')
    publisher = node.create_publisher(message_class(topics.RAW.type), topic, qos_of(topics.RAW))
    _spin(node, lambda: publisher.get_subscription_count() > 0)
    listened = publisher.get_subscription_count() > 0
    pixels = np.zeros((_ROWS, _COLUMNS, 3), dtype=np.uint8)
    for number in range(count if listened else 0):
        publisher.publish(image_message(number, 'doctor', pixels))
    publisher.wait_for_all_acked(Duration(seconds=_DEADLINE_S))
    return {'sent': count if listened else 0, 'frame_bytes': pixels.nbytes}


def _spin(node, condition):
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + _DEADLINE_S
    while not condition() and time.monotonic() < end:
        executor.spin_once(timeout_sec=_STEP_S)


def _graph(seconds):
    """Every topic with who publishes and subscribes, and the pairs that do not match."""
    from rclpy.node import Node

    node = Node('doctor')
    # Names and what is offered come with a heartbeat, every 3 s.
    end = time.monotonic() + seconds
    _spin(node, lambda: time.monotonic() > end)
    found = []
    for name, types in sorted(node.get_topic_names_and_types()):
        publishers = _others(node, node.get_publishers_info_by_topic(name))
        subscriptions = _others(node, node.get_subscriptions_info_by_topic(name))
        if publishers or subscriptions:
            found.append(
                {
                    'name': name,
                    'types': types,
                    'publishers': [_endpoint(publisher) for publisher in publishers],
                    'subscriptions': [_endpoint(subscription) for subscription in subscriptions],
                    'mismatches': _mismatches(publishers, subscriptions),
                }
            )
    return {'topics': found}


def _others(node, endpoints):
    return [endpoint for endpoint in endpoints if endpoint.node_name != node.get_name()]


def _endpoint(info):
    profile = info.qos_profile
    return {
        'node': _name(info),
        'reliability': profile.reliability.name.lower(),
        'durability': profile.durability.name.lower(),
    }


def _name(info):
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _mismatches(publishers, subscriptions):
    from rclpy.qos import QoSCompatibility, qos_check_compatible

    found = []
    for offer in publishers:
        for request in subscriptions:
            if offer.topic_type != request.topic_type:
                reason = f'the types differ: {offer.topic_type}, {request.topic_type}'
            else:
                compatible, reason = qos_check_compatible(offer.qos_profile, request.qos_profile)
                # A new object every time: `is` would never hold.
                if compatible != QoSCompatibility.ERROR:
                    continue
            pair = {'publisher': _name(offer), 'subscription': _name(request)}
            found.append({**pair, 'reason': reason.strip()})
    return found


_TASKS = {
    'receive': lambda topic, count: _received(topic, int(count)),
    'send': lambda topic, count: _sent(topic, int(count)),
    'graph': lambda seconds: _graph(float(seconds)),
}


def main(arguments):
    """Do what was asked, and print the answer."""
    task, *rest = arguments
    if task == 'import':
        print(json.dumps(_imported()))
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
