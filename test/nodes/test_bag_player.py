"""The bag player: services, clock, latched topics, foreign topics, invalid parameters."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of, stamp_of
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.image_messages import frame_from_compressed
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.recordings.offered_qos import OfferedQos
from nanorocks_ros.wire import topics

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'
NS = 10**9


class Remote:
    """Calls the services of a player, and receives what it plays."""

    def __init__(self, graph):
        self._graph = graph
        self.clock, self.frames, self.epochs = [], [], []
        node = graph.node
        node.create_subscription(
            Clock, '/clock', lambda m: self.clock.append(stamp_of(m.clock)), 100
        )
        node.create_subscription(
            CompressedImage,
            topics.RAW_COMPRESSED.name,
            lambda m: self.frames.append(stamp_of(m.header.stamp)),
            qos_of(topics.RAW_COMPRESSED),
        )
        node.create_subscription(Time, topics.EPOCH.name, self.epochs.append, qos_of(topics.EPOCH))

    def call(self, name):
        return self._call(Trigger, name, Trigger.Request())

    def set(self, name, value):
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        return self._call(SetParameters, 'set_parameters', request).results[0]

    def _call(self, kind, name, request):
        client = self._graph.node.create_client(kind, f'/nanorocks/bag_player/{name}')
        self._graph.until(client.service_is_ready)
        future = client.call_async(request)
        self._graph.until(future.done)
        return future.result()

    def ticks(self):
        """The next five times that the clock tells."""
        self.clock.clear()
        self._graph.until(lambda: len(self.clock) >= 5)
        return self.clock[:5]

    def next_frame(self):
        before = len(self.frames)
        assert self.call('play_next').success
        self._graph.until(lambda: len(self.frames) > before)
        return self.frames[-1]


def test_a_player_pauses_steps_seeks_and_resumes_and_so_does_its_clock(graph):
    bag = open_bag(SAMPLE)
    played = bag.messages([topics.RAW_COMPRESSED.absolute()])
    stamps = [stamp_of(bag.deserialize(message).header.stamp) for message in played]
    start_ns = bag.start_ns
    remote = Remote(graph)
    part = ('start:=1.0', 'duration:=15.0', 'position:=2.0')
    player = graph.start('bag_player', f'bag:={SAMPLE}', 'paused:=true', *part, 'listeners:=1')
    assert remote.ticks() == 5 * [start_ns + 2 * NS]
    assert remote.call('is_paused').success
    graph.until(lambda: remote.epochs)
    assert remote.next_frame() == stamps[60]
    assert remote.next_frame() == stamps[61]

    known = len(remote.epochs)
    assert remote.set('position', 10.0).successful
    graph.until(lambda: len(remote.epochs) > known)
    assert remote.ticks() == 5 * [start_ns + 10 * NS]
    assert remote.next_frame() == stamps[300]
    assert remote.set('position', 2.0).successful
    assert remote.next_frame() == stamps[60]

    beyond = remote.set('position', 18.0)
    assert not beyond.successful
    assert '18 s is outside the range that is played, 1.000 to 16.000 s' in beyond.reason
    assert not remote.set('rate', -1.0).successful
    assert not remote.set('start', 3.0).successful

    assert remote.set('rate', 2.0).successful
    assert remote.call('resume').message.startswith('playing at 2.0')
    assert not remote.call('play_next').success
    graph.until(lambda: len(remote.frames) > 20)
    assert remote.frames[4:] == stamps[61 : 61 + len(remote.frames) - 4]
    assert sorted(remote.ticks()) == remote.clock[:5]
    answer = remote.call('toggle_paused')
    assert answer.success
    remote.ticks()
    (held_ns,) = set(remote.ticks())
    assert answer.message == f'paused at {(held_ns - start_ns) / NS:.3f} s'
    assert remote.set('position', 15.5).successful
    assert set(remote.ticks()) == {start_ns + 15 * NS + NS // 2}
    assert remote.call('resume').success
    assert graph.wait(player).code == 0
    assert remote.frames[-1] == stamps[479]


def test_a_seek_back_resets_the_stages_and_sim_time_is_that_of_the_bag(graph):
    remote = Remote(graph)
    reports = []
    graph.node.create_subscription(DiagnosticArray, '/diagnostics', reports.append, 10)
    stage = graph.start('preprocessor', 'transport:=compressed', 'use_sim_time:=true')
    graph.start('bag_player', f'bag:={SAMPLE}', 'start:=5.0', 'listeners:=2')
    graph.until(lambda: len(remote.frames) > 30)
    assert remote.set('position', 5.0).successful
    graph.until(lambda: 'time went back by' in graph.output(stage))
    assert 'starting afresh' in graph.output(stage)
    names = '/nanorocks/preprocessor'
    times = [stamp_of(report.header.stamp) for report in reports if report.status[0].name == names]
    assert times
    start_ns = open_bag(SAMPLE).start_ns
    assert all(time == 0 or start_ns < time < start_ns + 60 * NS for time in times)
    assert any(times)
    ended = graph.interrupt(stage)
    assert ended.code == 0
    assert 'Traceback' not in ended.output


def foreign_bag(path):
    """Topics that are not of the graph: one latched, one of an unknown type, a clock."""
    latched = OfferedQos(transient_local=True, depth=3)
    table = {
        '/notes': OfferedTopic(msgtype='std_msgs/msg/String', qos=latched),
        '/often': OfferedTopic(msgtype='std_msgs/msg/String', qos=OfferedQos(reliable=False)),
        '/odd': OfferedTopic(msgtype='odd_msgs/msg/Odd', qos=OfferedQos(), definition='int32 x'),
        '/clock': OfferedTopic(msgtype='builtin_interfaces/msg/Time', qos=OfferedQos()),
    }

    class Text:
        def __init__(self, data):
            self.data = data

    class Odd:
        x = 1

    with BagWriter(path, table, metadata={}) as bag:
        bag.write('/notes', NS, Text('first'))
        bag.write('/odd', NS, Odd())
        bag.write('/clock', NS, time_message(7))
        for k in range(40):
            bag.write('/often', NS + k * NS // 10, Text(str(k)))
    return path


def test_foreign_topics_are_played_with_the_recorded_qos(graph, tmp_path):
    """Without a camera, from the middle, in a loop; a second camera and clock are reported."""
    notes, often, clock = [], [], []
    late = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node = graph.node
    node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
    node.create_publisher(Clock, '/clock', 10)
    best_effort = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_subscription(String, '/often', lambda m: often.append(int(m.data)), best_effort)
    node.create_subscription(Clock, '/clock', lambda m: clock.append(stamp_of(m.clock)), 100)
    path = foreign_bag(tmp_path / 'bag')
    player = graph.start('bag_player', f'bag:={path}', 'loop:=true', 'start:=2.0', 'rate:=4.0')
    graph.until(lambda: 39 in often and often[-1] < 30 and 3 * NS in clock)
    assert min(often) == 20
    assert min(clock) == 3 * NS
    # What comes before the part that is played is still latched in it.
    node.create_subscription(String, '/notes', lambda m: notes.append(m.data), late)
    graph.until(lambda: notes)
    assert set(notes) == {'first'}
    (info,) = node.get_publishers_info_by_topic('/often')
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    graph.until(lambda: graph.output(player).count('their messages are mixed') == 2)
    ended = graph.interrupt(player)
    assert ended.code == 0
    assert (
        '/odd: message type odd_msgs/msg/Odd is not installed; the topic is not played'
        in ended.output
    )
    for name in ('/nanorocks/camera/image_raw', '/clock'):
        warning = f'{name}: published by /nanorocks/bag_player and /nanorocks/listener, their'
        assert warning in ended.output, ended.output
    assert 'a clock of its own (-r /clock:=/NAME/clock' in ended.output
    assert 'Traceback' not in ended.output


def test_a_raw_recording_is_encoded_as_jpeg_when_somebody_subscribes(graph, tmp_path):
    name = topics.RAW.absolute()
    table = {name: OfferedTopic(msgtype=topics.RAW.type, qos=OfferedQos())}
    picture = np.full((48, 64, 3), (200, 120, 40), dtype=np.uint8)
    with BagWriter(tmp_path / 'raw', table, metadata={}) as bag:
        stamps = [NS + k * NS // 10 for k in range(5)]
        for stamp_ns in stamps:
            bag.write(name, stamp_ns, image_message(stamp_ns, 'camera', 'rgb8', picture))
    received = []
    graph.node.create_subscription(
        CompressedImage, topics.RAW_COMPRESSED.name, received.append, qos_of(topics.RAW_COMPRESSED)
    )
    player = graph.start('bag_player', f'bag:={tmp_path / "raw"}', 'listeners:=1')
    assert graph.wait(player).code == 0
    frames = [frame_from_compressed(message, 'jpeg') for message in received]
    assert [frame.stamp_ns for frame in frames] == stamps
    for frame in frames:
        assert frame.image.shape == picture.shape
        assert np.abs(frame.image.astype(int) - picture[:, :, ::-1]).max() <= 3


def test_invalid_messages_and_topic_names_are_skipped(graph, tmp_path):
    name = topics.RAW_COMPRESSED.absolute()
    frames = list(itertools.islice(open_bag(SAMPLE).messages([name]), 6))
    contents = [message.cdr for message in frames]
    contents[2:5] = contents[2][:6], b'', contents[4][: len(contents[4]) // 2]
    table = {
        name: OfferedTopic(msgtype=topics.COMPRESSED, qos=OfferedQos()),
        '/1st name': OfferedTopic(msgtype='std_msgs/msg/String', qos=OfferedQos()),
    }
    path = tmp_path / 'bag'
    with BagWriter(path, table, metadata={}) as bag:
        bag.write_raw('/1st name', frames[0].log_time_ns, b'')
        for message, cdr in zip(frames, contents, strict=True):
            bag.write_raw(name, message.log_time_ns, cdr)
    received = []
    graph.node.create_subscription(Image, topics.RAW.name, received.append, qos_of(topics.RAW))
    ended = graph.wait(graph.start('bag_player', f'bag:={path}', 'listeners:=1'))
    assert ended.code == 0
    stamps = [frames[k].log_time_ns - frames[0].log_time_ns for k in (0, 1, 5)]
    played = [stamp_of(message.header.stamp) for message in received]
    assert [stamp_ns - played[0] for stamp_ns in played] == stamps
    lines = ended.output.splitlines()
    assert len(lines) == 3
    assert '/1st name: not a valid ROS topic name; the topic is not played' in lines[0]
    # Of the two that differ in their size alone, the first.
    assert f'{name}: a message of 6 bytes is not a valid {topics.COMPRESSED}; record' in lines[1]
    # What the reader says of a message that is cut off.
    assert topics.COMPRESSED in lines[2]


def test_the_bag_player_gives_the_clock_and_starts_again_at_the_end(graph):
    clock = []
    graph.node.create_subscription(Clock, '/clock', lambda m: clock.append(stamp_of(m.clock)), 100)
    player = graph.start('bag_player', f'bag:={SAMPLE}', 'rate:=0.0', 'loop:=true')
    graph.until(lambda: any(after < before for before, after in itertools.pairwise(clock)))
    assert graph.interrupt(player).code == 0


def test_a_bag_that_does_not_exist_ends_the_player_with_one_line(graph):
    finished = graph.wait(graph.start('bag_player', 'bag:=/no/such/bag'))
    assert finished.code == 1
    assert '/no/such/bag' in finished.output
    assert len(finished.output.splitlines()) == 1, finished.output


@pytest.mark.parametrize(
    ('name', 'source', 'kind'),
    [('bag_player', (), 'message'), ('pipeline', ('source:=bag',), 'frame')],
)
def test_a_loop_over_nothing_ends_with_one_line(graph, name, source, kind):
    part = (f'bag:={SAMPLE}', 'start:=0.005', 'duration:=0.001', 'loop:=true')
    finished = graph.wait(graph.start(name, *source, *part))
    assert finished.code == 2
    assert f'parameters start and duration: {SAMPLE} holds no {kind} from' in finished.output
    assert len(finished.output.splitlines()) == 1, finished.output


def test_a_position_outside_the_range_ends_the_player_with_one_line(graph):
    position = ('start:=2.0', 'position:=1.0')
    finished = graph.wait(graph.start('bag_player', f'bag:={SAMPLE}', *position))
    assert finished.code == 2
    expected = 'parameter position: 1 s is outside the range that is played, 2.000 to 22.467 s'
    assert expected in finished.output
    assert len(finished.output.splitlines()) == 1, finished.output
