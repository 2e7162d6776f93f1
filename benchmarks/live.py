"""Live graph at 1080p and 30 Hz for 20 s: received frames, latency, CPU.

`simulator` and `pipeline` (source: topic) run in processes of their own and talk over DDS. A
third process, this one, receives the truth (one message per frame sent) and the gray tray image
(one message per frame processed), and compares the stamp of the frame with the clock.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np

_SECONDS = 20.0
_SETTLE_S = 20.0
_DOMAIN = '87'


class _Tally:
    def __init__(self, node) -> None:
        from nanorocks_ros.wire import topics

        self.sent: set[float] = set()
        self.latencies: dict[int, float] = {}
        self._node = node
        node.listen(topics.TRUTH, lambda m: self.sent.add(m.data[0]), 1, required=False)
        node.listen(topics.GRAY, self._processed, 1, required=False)

    def _processed(self, message) -> None:
        from nanorocks_ros.nodes.base.communication.ros_messages import stamp_of

        stamp_ns = stamp_of(message.header.stamp)
        self.latencies[stamp_ns] = 1e-9 * (time.time_ns() - stamp_ns)


def start_node(*arguments: str, **options) -> subprocess.Popen:
    """Start a node in a process of its own."""
    return subprocess.Popen([sys.executable, '-m', 'nanorocks_ros.nodes', *arguments], **options)


def spin(executor, seconds: float, stop=lambda: False) -> None:
    """Spin for some seconds, or until `stop` returns true."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and not stop():
        executor.spin_once(timeout_sec=0.1)


@contextmanager
def listener(domain: str):
    """A node in a separate domain on this host, and its executor."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = domain
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from nanorocks_ros.nodes.base.node import NanorocksNode

    rclpy.init()
    node = NanorocksNode('benchmark')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    yield node, executor
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()


def report() -> None:
    """Run the graph and print the received frames."""
    with listener(_DOMAIN) as (node, executor):
        _measure(node, executor)


def _measure(node, executor) -> None:
    from nanorocks_ros.wire import topics

    tally = _Tally(node)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    pipeline = start_node('pipeline', '--ros-args', '-p', 'source:=topic')
    camera = topics.RAW.absolute()
    spin(executor, _SETTLE_S, lambda: node.count_subscribers(camera) > 0)
    simulator = start_node(
        'simulator', '--ros-args', '-p', 'listeners:=1', '-p', f'duration:={_SECONDS}'
    )
    spin(executor, _SETTLE_S + 2 * _SECONDS, lambda: simulator.poll() is not None)
    spin(executor, 1.0)
    pipeline.send_signal(2)
    pipeline.wait(10)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    _print(tally, (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime))


def _print(tally: _Tally, cpu: float) -> None:
    latencies = 1e3 * np.array(sorted(tally.latencies.values()))
    print(f'frames sent {len(tally.sent)}, received {len(latencies)}')
    print(
        f'latency, median {np.median(latencies):.1f} ms, p99 {np.quantile(latencies, 0.99):.1f} ms'
    )
    print(f'CPU of both nodes, start-up included: {cpu / _SECONDS:.2f} cores')
