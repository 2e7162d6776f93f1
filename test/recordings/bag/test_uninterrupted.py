"""Interruptions wait for the end of a block, so that no recording is half written."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import suppress

import pytest
from rosbags.rosbag2 import storage_mcap

from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.uninterrupted import uninterrupted
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import time_message
from nanorocks_ros.recordings.offered_qos import OfferedQos

TOPIC = '/epoch'
TOPICS = {TOPIC: OfferedTopic(msgtype='builtin_interfaces/msg/Time', qos=OfferedQos())}


@pytest.fixture(autouse=True)
def interruptible():
    """The handler of a program that runs in the foreground."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interruption_waits_for_the_end_of_the_outermost_block():
    done = []

    def interrupted():
        with uninterrupted():
            with uninterrupted():
                signal.raise_signal(signal.SIGINT)
                done.append('inner')
            done.append('outer')

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ['inner', 'outer']
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_and_ignored_interruptions_run_as_they_are():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with uninterrupted():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    done = []

    def block():
        with uninterrupted():
            done.append(True)

    thread = threading.Thread(target=block)
    thread.start()
    thread.join()
    assert done == [True]


class InterruptedLine:
    """Interrupts at the n-th line that the writer of rosbags executes."""

    def __init__(self, line):
        self.left = line

    def __call__(self, frame, event, _):
        if frame.f_code.co_filename != storage_mcap.__file__:
            return None
        if event == 'line':
            self.left -= 1
            if self.left == 0:
                signal.raise_signal(signal.SIGINT)
        return self


def interrupted_recording(path, line):
    """A recording of three messages whose writing was interrupted in the third; lines left."""
    with BagWriter(path, TOPICS, metadata={}) as writer:
        writer.write(TOPIC, 0, time_message(0))
        writer.write(TOPIC, 1, time_message(1))
        tracer, before = InterruptedLine(line), sys.gettrace()
        sys.settrace(tracer)
        try:
            writer.write(TOPIC, 2_000_000_000, time_message(2))
        finally:
            sys.settrace(before)
    return tracer.left


def test_an_interruption_at_any_line_of_a_write_leaves_whole_messages(tmp_path):
    line, left = 0, 0
    while left <= 0:
        line += 1
        path = tmp_path / f'{line}'
        with suppress(KeyboardInterrupt):
            left = interrupted_recording(path, line)
        bag = open_bag(path)
        assert (bag.topics[TOPIC].count, bag.notices) == (3, ())
    # The write has lines, and so has the chunk that it closes.
    assert line > 40
