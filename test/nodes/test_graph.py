"""The graph of separate nodes over real DDS: from a bag and from the simulator."""

from __future__ import annotations

import signal
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray

from nanorocks_ros.records import CorEstimate, GroundTruth, SpeedEstimate
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout

from .result_arrays import SAMPLE, ResultArrays, assert_same_numbers

STAGES = ('preprocessor', 'speed_estimator', 'cluster_autocorrelator', 'haff_fitter')


def listening_to(graph, topic, count=1):
    name = graph.node.resolve_topic_name(topic.of(1))
    graph.until(lambda: graph.node.count_subscribers(name) >= count)


def test_a_bag_through_separate_nodes_gives_the_same_numbers_as_offline(graph):
    """Though the fitter is held up, and speeds and contacts wait for it side by side.

    And a subscriber that comes when all is over still gets the final restitution.
    """
    arrays = ResultArrays(graph.node)
    stages = [graph.start_program(name) for name in STAGES]
    listening_to(graph, topics.SPEED, 2)
    player = graph.start_program('bag_player', f'bag:={SAMPLE}', 'rate:=0.0', 'listeners:=3')
    while player.poll() is None:
        stages[-1].send_signal(signal.SIGSTOP)
        time.sleep(0.4)
        stages[-1].send_signal(signal.SIGCONT)
        graph.executor.spin_once(timeout_sec=0.1)
    finished = graph.wait(player)
    assert finished.code == 0, finished.output
    graph.until(lambda: arrays.final_cors())
    late = ResultArrays(graph.node)
    graph.until(lambda: late.final_cors())
    assert not late.messages[SpeedEstimate]
    for stage in stages:
        ended = graph.interrupt(stage)
        assert ended.code == 0, ended.output
        assert 'Traceback' not in ended.output
    # The fitter gets speeds rounded to float32, which the fit amplifies; an end of the interval of
    # 68 % of an exponent may lie near 0.
    # The readout that few rebounds tell doubles what rounding changes while a cycle is young.
    assert_same_numbers(arrays, rounding=1e-4, missed=0)


def test_the_simulator_drives_the_graph_and_tells_the_truth(graph):
    arrays = ResultArrays(graph.node)
    diagnostics = []
    graph.node.create_subscription(DiagnosticArray, '/diagnostics', diagnostics.append, 10)
    stages = [graph.start_program(name) for name in STAGES]
    listening_to(graph, topics.GRAY, 2)
    listening_to(graph, topics.RAW)
    small = ('width_px:=240', 'height_px:=240', 'first_shake:=0.5', 'rate:=0.0')
    simulator = graph.start_program('simulator', *small, 'listeners:=3', 'duration:=9.0')
    assert graph.wait(simulator).code == 0
    graph.until(lambda: arrays.messages[CorEstimate])
    truth = arrays.records(GroundTruth)
    assert truth[-1].stamp_ns / 1e9 == pytest.approx(9.0, abs=0.05)
    steps = np.diff([record.stamp_ns for record in truth]) / 1e9
    assert steps == pytest.approx(1 / 30, abs=1e-4)
    speeds = arrays.records(SpeedEstimate)
    assert speeds[-1].cycle == 1
    labels = arrays.messages[CorEstimate][0].layout.dim[0]
    assert labels.label == layout(CorEstimate).label
    assert labels.size == len(layout(CorEstimate).elements)
    names = {status.name for message in diagnostics for status in message.status}
    assert names >= {f'/nanorocks/{name}' for name in STAGES}
    keys = {
        pair.key for message in diagnostics for status in message.status for pair in status.values
    }
    assert keys >= {'tray 1 quality', 'tray 1 speed', 'tray 1 COR', 'priors'}
    for stage in stages:
        assert graph.interrupt(stage).code == 0
