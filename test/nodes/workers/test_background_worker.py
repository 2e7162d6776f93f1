"""Work in a thread: results in order, delivered in the thread of the node."""

from __future__ import annotations

import threading
import time

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes.workers.background_worker import BackgroundWorker


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

    background = BackgroundWorker(node, work, take)
    for number in range(20):
        background.put(number)
    spin_until(lambda: len(taken) == 20)
    background.close()
    assert taken == [(number, threading.get_ident()) for number in range(20)]
    assert threading.get_ident() not in threads
    assert len(threads) == 1


def test_draining_delivers_all_results(spun):
    node, _ = spun
    taken = []
    background = BackgroundWorker(node, lambda number: number, taken.append)
    for number in range(100):
        background.put(number)
    background.drain()
    background.close()
    assert taken == list(range(100))


def test_an_error_is_raised_where_the_node_runs(spun):
    node, spin_until = spun

    def work(_):
        raise ValueError('no such tray')

    background = BackgroundWorker(node, work, None)
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

    others = set(threading.enumerate())
    background = BackgroundWorker(node, work, lambda _: None)
    (thread,) = set(threading.enumerate()) - others
    for number in range(5):
        background.put(number)
    assert begun.wait(20.0)
    background.close()
    go_on.set()
    thread.join(20.0)
    assert not thread.is_alive()
    assert done == [0]


def test_an_interrupt_ends_the_wait_for_room(spun):
    node, _ = spun
    go_on = threading.Event()
    background = BackgroundWorker(node, lambda _: go_on.wait(20.0), lambda _: None)

    def interrupt():
        background.interrupted = True

    threading.Timer(0.2, interrupt).start()
    taken = 0
    while not background.interrupted:
        # Returns also when the queue is full, which it stays.
        background.put(taken)
        taken += 1
    assert 30 <= taken <= 32
    assert background.waiting == 30
    background.close()
    go_on.set()
