"""What `pipeline record:=PATH` leaves behind: at the end, after a kill, and beside a player."""

from __future__ import annotations

import resource
import signal
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.wire import topics

SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'
CAMERA = topics.RAW_COMPRESSED.absolute()
SMALL = (
    'simulation.width_px:=240',
    'simulation.height_px:=240',
    'simulation.first_shake:=0.5',
)


def recorded(bag, topic, tray=1):
    return [bag.deserialize(message) for message in bag.messages([topic.absolute(tray)])]


def pictures(bag):
    return [bytes(message.data) for message in recorded(bag, topics.RAW_COMPRESSED)]


def test_a_recording_of_the_simulator_gives_the_same_speeds_again(graph, tmp_path):
    path = tmp_path / 'räume und' / 'bag'
    graph_of = graph.start('pipeline', *SMALL, 'rate:=0.0', 'duration:=6.0', f'record:={path}')
    finished = graph.wait(graph_of)
    assert finished.code == 0, finished.output
    bag = open_bag(path)
    assert bag.complete
    assert not bag.notices
    assert bag.metadata['source'] == 'simulator'
    assert bag.topics[CAMERA].count == 180
    assert bag.topics[topics.TRUTH.absolute(1)].count == 180
    live = np.array([message.data[:5] for message in recorded(bag, topics.SPEED)])
    (epoch,) = recorded(bag, topics.EPOCH)
    again = analyse(path, PipelineSettings())
    assert again.epoch_ns == epoch.sec * 10**9 + epoch.nanosec
    times = [(speed.stamp_ns - again.epoch_ns) / 1e9 for speed in again.trays[1].speeds]
    assert times == pytest.approx(live[:, 0].tolist(), abs=1e-3)
    speeds = [speed.mean_projected_speed.value for speed in again.trays[1].speeds]
    # The recording holds JPEGs, the pipeline saw the frames before.
    moving = live[:, 0] > 2.0
    assert np.mean(np.array(speeds)[moving]) == pytest.approx(np.mean(live[moving, 3]), rel=0.03)


def test_after_a_kill_all_results_older_than_two_seconds_are_readable(graph, tmp_path):
    heard = {topics.SPEED: [], topics.TRUTH: []}
    for topic, received in heard.items():
        graph.node.create_subscription(
            Float32MultiArray,
            topic.of(1),
            lambda message, received=received: received.append((time.monotonic(), message)),
            qos_of(topic),
        )
    path = tmp_path / 'bag'
    process = graph.start('pipeline', *SMALL, f'record:={path}')
    graph.until(lambda: len(heard[topics.TRUTH]) >= 150)
    killed = time.monotonic()
    process.send_signal(signal.SIGKILL)
    process.wait()
    bag = open_bag(path)
    assert not bag.complete
    assert not (path / 'metadata.yaml').exists()
    for topic, received in heard.items():
        due = {message.data.tobytes() for at, message in received if at < killed - 2.0}
        in_bag = {message.data.tobytes() for message in recorded(bag, topic)}
        assert len(due) > 15, topic.name
        assert due <= in_bag, topic.name
    # Of each truth there was a frame.
    seconds = (bag.end_ns - bag.start_ns) / 1e9
    assert abs(bag.topics[CAMERA].count - 30 * seconds) <= 3


def test_a_recording_that_ends_before_its_time_is_an_alarm(graph, tmp_path):
    told = []
    graph.node.create_subscription(
        DiagnosticArray,
        '/diagnostics',
        lambda message: told.extend(
            (status.level, {pair.key: pair.value for pair in status.values})
            for status in message.status
        ),
        10,
    )
    path = tmp_path / 'bag'
    process = graph.start('pipeline', *SMALL, f'record:={path}')
    graph.until(lambda: any(float(values.get('disk left [GB]', 0)) > 0 for _, values in told))
    # No file may become larger: as if the disk were full.
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
    graph.until(lambda: any('alarm: recording stopped' in values for _, values in told))
    level, values = told[-1]
    assert level == DiagnosticStatus.ERROR
    assert values['alarm: recording stopped'].startswith(str(path))
    assert 'the graph continues' in values['alarm: recording stopped']
    assert list(open_bag(path).messages([topics.SPEED.absolute(1)]))


@pytest.mark.parametrize(
    'signals', [(signal.SIGINT, signal.SIGTERM), (signal.SIGTERM, signal.SIGINT)]
)
def test_two_signals_end_the_pipeline_with_a_complete_recording(graph, tmp_path, signals):
    """As `ros2 launch` and a second Ctrl-C send them."""
    heard = []
    graph.node.create_subscription(
        Float32MultiArray, topics.TRUTH.of(1), heard.append, qos_of(topics.TRUTH)
    )
    path = tmp_path / 'bag'
    process = graph.start('pipeline', *SMALL, f'record:={path}')
    graph.until(lambda: len(heard) >= 30)
    for number in signals:
        process.send_signal(number)
        time.sleep(0.05)
    finished = graph.wait(process)
    assert finished.code == 0, finished.output
    bag = open_bag(path)
    assert bag.complete
    assert not bag.notices
    assert bag.topics[CAMERA].count >= 30


def test_a_recording_that_cannot_be_completed_gives_exit_code_1(graph, tmp_path):
    path = tmp_path / 'bag'
    process = graph.start('pipeline', *SMALL, f'record:={path}')
    recorded = path / 'bag.mcap'
    graph.until(lambda: recorded.exists() and recorded.stat().st_size > 20_000)
    process.send_signal(signal.SIGSTOP)
    # What follows does not fit on the disk; the few lines of the log do.
    size = recorded.stat().st_size
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size, size))
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGCONT)
    finished = graph.wait(process)
    assert finished.code == 1
    assert f'{path}: cannot be written' in finished.output
    assert 'Traceback' not in finished.output


def test_a_player_without_pace_loses_nothing_on_its_way_into_a_recording(graph, tmp_path):
    """Frames are kept as they came, and the same ones make the same numbers."""
    path = tmp_path / 'bag'
    # As a user starts them: forked at the same moment, on a busy machine, the first frames may
    # come before the subscription is known on both sides.
    pipeline = graph.start_program(
        'pipeline', 'source:=topic', 'transport:=compressed', f'record:={path}'
    )
    player = graph.start_program(
        'bag_player', f'bag:={SAMPLE}', 'rate:=0.0', 'listeners:=1', 'start:=1.0', 'duration:=6.0'
    )
    assert graph.wait(player).code == 0
    ended = graph.interrupt(pipeline)
    assert ended.code == 0, ended.output
    source, bag = open_bag(SAMPLE), open_bag(path)
    first_ns = source.start_ns + 10**9
    played = source.messages([CAMERA], first_ns, first_ns + 6 * 10**9 - 1)
    assert pictures(bag) == [bytes(source.deserialize(message).data) for message in played]
    (epoch,) = recorded(bag, topics.EPOCH)
    assert epoch.sec * 10**9 + epoch.nanosec == source.start_ns
    live = np.array([message.data for message in recorded(bag, topics.SPEED)])
    again = np.array(
        [
            speed.mean_projected_speed.value
            for speed in analyse(path, PipelineSettings()).trays[1].speeds
        ]
    )
    np.testing.assert_array_equal(live[:, 3], again[: len(live)].astype(np.float32))
    assert len(again) - len(live) <= 1
