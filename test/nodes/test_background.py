"""Work in a thread beside the node: in order, handed over in the thread of the node."""

from __future__ import annotations

import threading
import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from nanorocks_ros.nodes._background import Background
from nanorocks_ros.nodes._now_and_then import NowAndThen


@pytest.fixture
def spun():
    """A node, and a function that spins it until something is so."""
    context = Context()
    rclpy.init(context=context)
    node = Node('background_test', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin_until(condition):
        end = time.monotonic() + 20.0
        while not condition() and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        assert condition()

    yield node, spin_until
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_results_come_in_order_and_in_the_thread_of_the_node(spun):
    node, spin_until = spun
    taken, threads = [], set()

    def work(number):
        threads.add(threading.get_ident())
        # The first jobs take longest.
        time.sleep(0.02 if number < 3 else 0.0)
        return number

    def take(number):
        taken.append((number, threading.get_ident()))

    background = Background(node, work, take)
    for number in range(20):
        background.put(number)
    spin_until(lambda: len(taken) == 20)
    background.close()
    assert taken == [(number, threading.get_ident()) for number in range(20)]
    assert threading.get_ident() not in threads
    assert len(threads) == 1


def test_draining_leaves_nothing_undone(spun):
    node, _ = spun
    taken = []
    background = Background(node, lambda number: number, taken.append)
    for number in range(100):
        background.put(number)
    background.drain()
    background.close()
    assert taken == list(range(100))


def test_an_error_is_raised_where_the_node_runs(spun):
    node, spin_until = spun

    def work(_):
        raise ValueError('no such tray')

    background = Background(node, work, None)
    background.put(1)
    with pytest.raises(ValueError, match='no such tray'):
        spin_until(lambda: False)
    background.close()


def test_closing_forgets_what_waits(spun):
    node, _ = spun
    begun, go_on, done = threading.Event(), threading.Event(), []

    def work(number):
        begun.set()
        go_on.wait(20.0)
        done.append(number)

    background = Background(node, work, lambda _: None)
    for number in range(5):
        background.put(number)
    assert begun.wait(20.0)
    threading.Timer(0.2, go_on.set).start()
    background.close()
    assert done == [0]


def test_members_of_a_group_for_now_and_then_run_only_once_it_is_open(spun):
    node, spin_until = spun
    group, calls = NowAndThen(), []
    timer = node.create_timer(0.001, lambda: calls.append(1), callback_group=group)
    others = []
    node.create_timer(0.001, lambda: others.append(1))
    spin_until(lambda: len(others) > 20)
    assert not calls
    group.open()
    spin_until(lambda: bool(calls))
    timer.cancel()
