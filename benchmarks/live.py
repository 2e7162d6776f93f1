"""Live graph at 1080p and 30 Hz for 20 s: frames that arrive, latency, CPU.

`simulator` and `pipeline` (source: topic) run in processes of their own and talk over DDS. A
third process, this one, listens to the truth (one message a frame sent) and to the gray tray
image (one message a frame processed) and compares the frame's stamp with the clock.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time

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
        from nanorocks_ros.nodes._shell import stamp_of

        stamp_ns = stamp_of(message.header.stamp)
        self.latencies[stamp_ns] = 1e-9 * (time.time_ns() - stamp_ns)


def _start(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, '-m', 'nanorocks_ros.nodes', *arguments])


def _spin(executor, seconds: float, stop=lambda: False) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not stop():
        executor.spin_once(timeout_sec=0.1)


def report() -> None:
    """Run the graph and print what arrived."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = _DOMAIN
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from nanorocks_ros.nodes._node import NanorocksNode
    from nanorocks_ros.wire import topics

    rclpy.init()
    node = NanorocksNode('benchmark')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    tally = _Tally(node)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    pipeline = _start('pipeline', '--ros-args', '-p', 'source:=topic')
    camera = topics.RAW.absolute()
    _spin(executor, _SETTLE_S, lambda: node.count_subscribers(camera) > 0)
    simulator = _start(
        'simulator', '--ros-args', '-p', 'listeners:=1', '-p', f'duration:={_SECONDS}'
    )
    _spin(executor, _SETTLE_S + 2 * _SECONDS, lambda: simulator.poll() is not None)
    _spin(executor, 1.0)
    pipeline.send_signal(2)
    pipeline.wait(10)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    node.destroy_node()
    rclpy.shutdown()
    _print(tally, (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime))


def _print(tally: _Tally, cpu: float) -> None:
    latencies = 1e3 * np.array(sorted(tally.latencies.values()))
    print(f'frames sent {len(tally.sent)}, received {len(latencies)}')
    print(
        f'latency, median {np.median(latencies):.1f} ms, p99 {np.quantile(latencies, 0.99):.1f} ms'
    )
    print(f'CPU of both nodes, start-up included: {cpu / _SECONDS:.2f} cores')
