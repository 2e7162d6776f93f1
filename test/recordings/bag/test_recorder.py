"""Recorder in a thread: dropped images, results that are never dropped, and a full disk."""

from __future__ import annotations

import random
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.recorder import Recorder
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    float_array_message,
)
from nanorocks_ros.recordings.offered_qos import OfferedQos

NS = 1_000_000_000
CAMERA, SPEED = '/camera', '/speed'
TOPICS = {
    CAMERA: OfferedTopic(msgtype='sensor_msgs/msg/CompressedImage', qos=OfferedQos()),
    SPEED: OfferedTopic(msgtype='std_msgs/msg/Float32MultiArray', qos=OfferedQos()),
}


def make_recorder(path, **options):
    return Recorder(path, TOPICS, metadata={}, **options)


def picture(stamp_ns, size=1000):
    return compressed_image_message(
        stamp_ns, 'camera', 'jpeg', random.Random(size).randbytes(size)
    )


def speed(value):
    return float_array_message(['speed'], [value])


def read(path):
    bag = open_bag(path)
    messages = list(bag.messages())
    return bag, messages


def test_a_slow_disk_drops_images_but_no_results(tmp_path):
    recorder = make_recorder(tmp_path / 'bag', max_queued_bytes=2000)
    recorder.advance(NS)
    slow = threading.Event()
    started = threading.Event()

    def held_up():
        started.set()
        slow.wait()
        return picture(0)

    queued = [recorder.put(CAMERA, held_up, size=1000)]
    started.wait()
    for k in range(1, 10):
        recorder.advance(NS + k * NS // 30)
        queued.append(recorder.put(CAMERA, lambda k=k: picture(k), size=1000))
        assert recorder.put(SPEED, lambda k=k: speed(float(k)))
    slow.set()
    recorder.close()
    assert queued == [True, True] + 8 * [False]
    assert recorder.dropped == 8
    bag, messages = read(tmp_path / 'bag')
    assert bag.complete
    assert [message.topic for message in messages].count(CAMERA) == 2
    values = [bag.deserialize(message).data[0] for message in messages if message.topic == SPEED]
    assert values == [float(k) for k in range(1, 10)]


def test_a_caller_that_waits_loses_no_image(tmp_path):
    recorder = make_recorder(tmp_path / 'bag', max_queued_bytes=2000)
    recorder.advance(NS)
    for k in range(20):
        assert recorder.put(CAMERA, lambda k=k: picture(k), size=1000, wait=True)
    recorder.close()
    assert recorder.dropped == 0
    assert recorder.written == 20


def test_log_times_continue_when_time_steps_back(tmp_path):
    """A reader gets the images in the order of their arrival."""
    stamps = [10 * NS, 11 * NS, 11 * NS - NS // 100, 12 * NS, 10 * NS, 11 * NS]
    recorder = make_recorder(tmp_path / 'bag')
    for stamp_ns in stamps:
        recorder.advance(stamp_ns)
        recorder.put(CAMERA, lambda s=stamp_ns: picture(s))
    recorder.close()
    bag, messages = read(tmp_path / 'bag')
    headers = [bag.deserialize(message).header.stamp for message in messages]
    assert [stamp.sec * NS + stamp.nanosec for stamp in headers] == stamps
    assert [message.log_time_ns // NS for message in messages] == [10, 11, 11, 12, 12, 13]


def test_messages_before_the_first_image_get_its_time(tmp_path):
    recorder = make_recorder(tmp_path / 'bag')
    recorder.put(SPEED, lambda: speed(7.0))
    recorder.advance(5 * NS)
    recorder.put(CAMERA, lambda: picture(5 * NS))
    recorder.close()
    bag, messages = read(tmp_path / 'bag')
    assert [message.topic for message in messages] == [SPEED, CAMERA]
    assert (bag.start_ns, bag.end_ns) == (5 * NS, 5 * NS)


def test_an_image_that_cannot_be_encoded_is_counted_and_the_next_one_written(tmp_path):
    def fail():
        raise FrameError('JPEG', 'cannot be encoded', 'give another')

    recorder = make_recorder(tmp_path / 'bag')
    recorder.advance(NS)
    recorder.put(CAMERA, fail)
    recorder.put(CAMERA, lambda: picture(0))
    recorder.close()
    assert (recorder.dropped, recorder.written, recorder.problem) == (1, 1, None)


def test_an_existing_path_is_refused(tmp_path):
    with pytest.raises(RecordingError, match='exists already and is not overwritten'):
        make_recorder(tmp_path)


FULL = """
import resource, sys, time
sys.path.insert(0, {folder!r})
from test_recorder import CAMERA, SPEED, make_recorder, picture, speed
import nanorocks_ros.recordings.bag.recorder as module
module._SYNC_S = 0.0
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
recorder = make_recorder({path!r})
for k in range(100):
    recorder.advance(k * 33_000_000)
    recorder.put(CAMERA, lambda k=k: picture(k, 10_000 + k), size=10_000, wait=True)
    recorder.put(SPEED, lambda k=k: speed(float(k)))
recorder.close()
assert not recorder.put(SPEED, lambda: speed(0.0))
print(recorder.written)
print(recorder.problem)
"""


def test_a_full_disk_ends_the_recording_and_keeps_written_messages(tmp_path):
    path = str(tmp_path / 'bag')
    script = FULL.format(path=path, folder=str(Path(__file__).parent))
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    written, problem = done.stdout.splitlines()
    assert problem.startswith(f'{path}: cannot be written (')
    bag, messages = read(path)
    assert not bag.complete
    # All messages except the one being written when the disk was full.
    assert int(written) - 2 <= len(messages) <= int(written)
    assert int(written) > 20
