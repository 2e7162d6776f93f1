"""What a node does with what it cannot use: one line, and it goes on, or ends with a code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image

from nanorocks_ros.nodes._shell import image_message, qos_of
from nanorocks_ros.wire import topics

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'
SPEED = 'qos_overrides./nanorocks/tray_1/speed.subscription'


def lines_with(output, text):
    return [line for line in output.splitlines() if text in line]


@pytest.mark.parametrize(
    ('name', 'parameter', 'message'),
    [
        ('haff_fitter', 'cooling.duration:=.nan', 'parameter cooling.duration'),
        ('haff_fitter', 'cooling.duration:=-3.0', 'parameter cooling.duration'),
        ('speed_estimator', 'trays:=[9]', 'trays: 9 is outside [1, 8]'),
        ('pipeline', 'speed.method:=guess', "'guess' is none of auto"),
        ('pipeline', 'simulation.tray:=3', 'parameter simulation.tray: 3 is not among trays'),
        ('pipeline', 'bag:=x', 'parameter bag: given, but source is simulator; set source:=bag'),
        ('preprocessor', 'trays_file:=/nowhere.yaml', '/nowhere.yaml: No such file'),
        ('simulator', 'noise:=-1.0', 'parameter noise'),
        ('bag_player', 'rate:=1.0', 'parameter bag: is empty; give the path of a bag'),
        ('bag_player', 'bag:=2015', """2015 is not a text; quote it twice: -p "bag:='2015'\""""),
        ('haff_fitter', f'{SPEED}.reliability:=best_efort', "'best_efort' is none of system_defa"),
        (
            'haff_fitter',
            f'{SPEED.replace("speed", "sped")}.depth:=3',
            "(did you mean '/nanorocks/tray_1/speed'?)",
        ),
        ('simulator', 'nois:=1.0', "no parameter 'nois' (did you mean 'noise'?)"),
    ],
)
def test_a_bad_parameter_ends_the_node_with_one_line(graph, name, parameter, message):
    finished = graph.wait(graph.start(name, parameter))
    assert finished.code == 2
    assert message in finished.output
    assert len(finished.output.splitlines()) == 1, finished.output


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


def test_a_position_outside_the_part_ends_the_player_with_one_line(graph):
    position = ('start:=2.0', 'position:=1.0')
    finished = graph.wait(graph.start('bag_player', f'bag:={SAMPLE}', *position))
    assert finished.code == 2
    said = 'parameter position: 1 s is not in the part that is played, 2.000 to 22.467 s'
    assert said in finished.output
    assert len(finished.output.splitlines()) == 1, finished.output


def test_unknown_ros_arguments_end_the_node_with_one_line(graph):
    finished = graph.wait(graph.start('haff_fitter', arguments=('--nonsense',)))
    assert finished.code == 2
    assert 'wrong ROS arguments' in finished.output
    assert 'Traceback' not in finished.output


def set_parameter(graph, node, name, value):
    client = graph.node.create_client(SetParameters, f'/nanorocks/{node}/set_parameters')
    graph.until(client.service_is_ready)
    parameter = Parameter(name, value=value).to_parameter_msg()
    future = client.call_async(SetParameters.Request(parameters=[parameter]))
    graph.until(future.done)
    return future.result().results[0]


def test_a_bad_change_of_a_parameter_is_rejected_with_the_reason(graph):
    process = graph.start('haff_fitter')
    bad = set_parameter(graph, 'haff_fitter', 'cooling.probability', float('nan'))
    assert not bad.successful
    assert 'cooling.probability' in bad.reason
    good = set_parameter(graph, 'haff_fitter', 'cooling.probability', 0.68)
    assert good.successful, good.reason
    whole = set_parameter(graph, 'haff_fitter', 'cooling.duration', 15)
    assert whole.successful, whole.reason
    assert graph.interrupt(process).code == 0


def test_a_change_that_does_not_fit_the_other_parameters_is_rejected_and_the_node_lives(graph):
    process = graph.start('preprocessor')
    mix = set_parameter(graph, 'preprocessor', 'preprocess.gray_mix', [1.0, 1.0, 1.0])
    assert not mix.successful
    assert 'whose sum is at most 1' in mix.reason
    trays = set_parameter(graph, 'preprocessor', 'trays', [1, 2])
    assert not trays.successful
    assert process.poll() is None
    assert graph.interrupt(process).code == 0


def test_a_camera_or_a_clock_that_nobody_publishes_is_said_within_seconds(graph):
    process = graph.start('preprocessor', 'use_sim_time:=true')
    said = '/nanorocks/camera/image_raw: no publisher within 5 s'
    graph.until(lambda: said in graph.output(process))
    graph.until(lambda: '/clock: nothing within 5 s, though use_sim_time' in graph.output(process))
    assert graph.interrupt(process).code == 0


def test_a_publisher_of_another_quality_of_service_is_said_with_both(graph):
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    graph.node.create_publisher(Image, topics.RAW.name, qos)
    process = graph.start('preprocessor')
    graph.until(lambda: 'no data' in graph.output(process))
    (line,) = lines_with(graph.output(process), 'no data')
    assert 'publisher offers reliability BEST_EFFORT and I ask for RELIABLE' in line
    assert graph.interrupt(process).code == 0


def test_the_mismatch_can_be_settled_by_the_override_that_the_line_names(graph):
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = graph.node.create_publisher(Image, topics.RAW.name, qos)
    name = 'qos_overrides./nanorocks/camera/image_raw.subscription.reliability'
    process = graph.start('preprocessor', f'{name}:=best_effort')
    graph.until(lambda: publisher.get_subscription_count() == 1)
    assert 'no data' not in graph.output(process)
    assert graph.interrupt(process).code == 0


class Camera:
    """Publishes pictures, sees what the preprocessor makes of them."""

    def __init__(self, graph):
        self._graph = graph
        self._publisher = graph.node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
        self.trays = []
        self.levels = []
        self.values = {}
        graph.node.create_subscription(
            Image, topics.GRAY.of(1), self.trays.append, qos_of(topics.GRAY)
        )
        graph.node.create_subscription(DiagnosticArray, '/diagnostics', self._diagnostics, 10)
        self._second = 0

    def _diagnostics(self, message):
        self.levels += [(one.level, one.message) for one in message.status]
        self.values.update({one.key: one.value for it in message.status for one in it.values})

    def publish(self, encoding=None, size=240, second=None, level=90):
        self._graph.until(lambda: self._publisher.get_subscription_count() == 1)
        self._second = self._second + 1 if second is None else second
        pixels = np.full((size, size, 3), level, np.uint8)
        stamp_ns = self._second * 1_000_000_000
        self._publisher.publish(image_message(stamp_ns, 'camera', pixels, encoding))

    def publish_until_seen(self, count):
        def seen():
            self.publish()
            return len(self.trays) >= count

        self._graph.until(seen)


@pytest.mark.parametrize(
    ('bad', 'message'),
    [
        ({'encoding': 'bayer_rggb8'}, "encoding 'bayer_rggb8' is not supported"),
        ({'size': 300}, 'the frame size changed from 240x240 to 300x300 px'),
    ],
)
def test_a_frame_that_cannot_be_used_is_refused_and_the_next_one_is_not(graph, bad, message):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    camera.publish_until_seen(1)
    camera.publish(**bad)
    graph.until(lambda: message in graph.output(process))
    camera.publish_until_seen(2)
    (line,) = lines_with(graph.output(process), message)
    assert '/nanorocks/camera/image_raw: ' in line
    graph.until(lambda: any(level == DiagnosticStatus.ERROR for level, _ in camera.levels))
    ended = graph.interrupt(process)
    assert ended.code == 0
    assert 'Traceback' not in ended.output


def test_time_that_goes_back_is_said(graph):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    camera.publish_until_seen(1)
    camera.publish(second=100)
    camera.publish(second=50)
    graph.until(lambda: 'time went back by 50.000 s; starting afresh' in graph.output(process))
    assert graph.interrupt(process).code == 0


def test_missing_frames_are_said_and_counted(graph):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    for second in (*range(1, 25), 28, 29):
        before = len(camera.trays)
        # Of other brightness, or they would be left out as the same frame again.
        camera.publish(second=second, level=60 + 2 * second)
        graph.until(lambda before=before: len(camera.trays) > before)
    said = '/nanorocks/camera/image_raw: 3 frames missing so far, by their stamps'
    graph.until(lambda: said in graph.output(process))
    graph.until(lambda: camera.values.get('frames missing') == '3')
    assert graph.interrupt(process).code == 0


def test_an_array_of_another_release_is_refused(graph):
    from std_msgs.msg import Float32MultiArray

    publisher = graph.node.create_publisher(
        Float32MultiArray, topics.SPEED.of(1), qos_of(topics.SPEED)
    )
    process = graph.start('haff_fitter')
    graph.until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(Float32MultiArray(data=[1.0, 2.0]))
    graph.until(lambda: '2 elements where SpeedEstimate has 13' in graph.output(process))
    assert graph.interrupt(process).code == 0


def test_the_epoch_reaches_those_who_come_late(graph):
    from builtin_interfaces.msg import Time

    camera = Camera(graph)
    process = graph.start('preprocessor')
    camera.publish_until_seen(1)
    epochs = []
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    graph.node.create_subscription(Time, topics.EPOCH.name, epochs.append, qos)
    graph.until(lambda: epochs)
    assert epochs[0].sec == 1
    assert graph.interrupt(process).code == 0
