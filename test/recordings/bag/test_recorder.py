"""Recording in a thread: what is left out, what never is, and what a failure leaves behind."""

from __future__ import annotations

import random
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.recorder import Recorder
from nanorocks_ros.recordings.bag.writer import OfferedQos, OfferedTopic
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    float_array_message,
)

NS = 1_000_000_000
CAMERA, SPEED = '/camera', '/speed'
TOPICS = {
    CAMERA: OfferedTopic(msgtype='sensor_msgs/msg/CompressedImage', qos=OfferedQos()),
    SPEED: OfferedTopic(msgtype='std_msgs/msg/Float32MultiArray', qos=OfferedQos()),
}


def recorder(path, **how):
    return Recorder(path, TOPICS, metadata={}, **how)


def picture(stamp_ns, size=1000):
    return compressed_image_message(
        stamp_ns, 'camera', 'jpeg', random.Random(size).randbytes(size)
    )


def speed(value):
    return float_array_message(['speed'], [value])


def held(path):
    bag = open_bag(path)
    messages = list(bag.messages())
    return bag, messages


def test_pictures_are_left_out_when_the_disk_does_not_keep_up_and_results_never_are(tmp_path):
    one = recorder(tmp_path / 'bag', most_bytes=2000)
    one.advance(NS)
    slow = threading.Event()
    begun = threading.Event()

    def held_up():
        begun.set()
        slow.wait()
        return picture(0)

    taken = [one.put(CAMERA, held_up, size=1000)]
    begun.wait()
    for k in range(1, 10):
        one.advance(NS + k * NS // 30)
        taken.append(one.put(CAMERA, lambda k=k: picture(k), size=1000))
        assert one.put(SPEED, lambda k=k: speed(float(k)))
    slow.set()
    one.close()
    assert taken == [True, True] + 8 * [False]
    assert one.dropped == 8
    bag, messages = held(tmp_path / 'bag')
    assert bag.complete
    assert [message.topic for message in messages].count(CAMERA) == 2
    values = [bag.deserialize(message).data[0] for message in messages if message.topic == SPEED]
    assert values == [float(k) for k in range(1, 10)]


def test_who_has_time_waits_and_nothing_is_left_out(tmp_path):
    one = recorder(tmp_path / 'bag', most_bytes=2000)
    one.advance(NS)
    for k in range(20):
        assert one.put(CAMERA, lambda k=k: picture(k), size=1000, wait=True)
    one.close()
    assert one.dropped == 0
    assert one.written == 20


def test_a_recording_goes_on_when_time_goes_back(tmp_path):
    """And who reads it meets the pictures in the order in which they came."""
    stamps = [10 * NS, 11 * NS, 11 * NS - NS // 100, 12 * NS, 10 * NS, 11 * NS]
    one = recorder(tmp_path / 'bag')
    for stamp_ns in stamps:
        one.advance(stamp_ns)
        one.put(CAMERA, lambda s=stamp_ns: picture(s))
    one.close()
    bag, messages = held(tmp_path / 'bag')
    found = [bag.deserialize(message).header.stamp for message in messages]
    assert [t.sec * NS + t.nanosec for t in found] == stamps
    assert [message.log_time_ns // NS for message in messages] == [10, 11, 11, 12, 12, 13]


def test_what_is_known_before_the_first_picture_is_recorded_with_it(tmp_path):
    one = recorder(tmp_path / 'bag')
    one.put(SPEED, lambda: speed(7.0))
    one.advance(5 * NS)
    one.put(CAMERA, lambda: picture(5 * NS))
    one.close()
    bag, messages = held(tmp_path / 'bag')
    assert [message.topic for message in messages] == [SPEED, CAMERA]
    assert (bag.start_ns, bag.end_ns) == (5 * NS, 5 * NS)


def test_a_picture_that_cannot_be_made_is_counted_and_the_next_one_is_written(tmp_path):
    def fail():
        raise FrameError('JPEG', 'cannot be encoded', 'give another')

    one = recorder(tmp_path / 'bag')
    one.advance(NS)
    one.put(CAMERA, fail)
    one.put(CAMERA, lambda: picture(0))
    one.close()
    assert (one.dropped, one.written, one.problem) == (1, 1, None)


def test_an_existing_path_is_refused(tmp_path):
    with pytest.raises(RecordingError, match='exists already and is not overwritten'):
        recorder(tmp_path)


FULL = """
import resource, sys, time
sys.path.insert(0, {folder!r})
from test_recorder import CAMERA, SPEED, picture, recorder, speed
import nanorocks_ros.recordings.bag.recorder as module
module._SYNC_S = 0.0
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
one = recorder({path!r})
for k in range(100):
    one.advance(k * 33_000_000)
    one.put(CAMERA, lambda k=k: picture(k, 10_000 + k), size=10_000, wait=True)
    one.put(SPEED, lambda k=k: speed(float(k)))
one.close()
assert not one.put(SPEED, lambda: speed(0.0))
print(one.written)
print(one.problem)
"""


def test_a_full_disk_ends_the_recording_and_loses_nothing_that_was_written(tmp_path):
    path = str(tmp_path / 'bag')
    script = FULL.format(path=path, folder=str(Path(__file__).parent))
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    written, problem = done.stdout.splitlines()
    assert problem.startswith(f'{path}: cannot be written (')
    bag, messages = held(path)
    assert not bag.complete
    # All but what was being written when the disk was full.
    assert int(written) - 2 <= len(messages) <= int(written)
    assert int(written) > 20
