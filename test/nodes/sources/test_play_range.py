"""The range of a bag that is played: in a loop, never empty, and what is lost is logged."""

from __future__ import annotations

import itertools

import pytest
from mcap.reader import make_reader

pytest.importorskip('rclpy')

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.nodes.sources.play_range import PlayRange
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.offered_qos import OfferedQos
from nanorocks_ros.settings import BagSettings

NS = 10**9
NAMES = ['/often']
SHORT = (0.0, 0.2, 0.4)


class Logger:
    """A node that only logs."""

    def __init__(self):
        self.lines = []

    def get_logger(self):
        return self

    def warning(self, line):
        self.lines.append(line)


def bag_with(path, seconds):
    """Strings at some times after the first."""
    table = {'/often': OfferedTopic(msgtype='std_msgs/msg/String', qos=OfferedQos())}

    class Text:
        data = 'some text'

    with BagWriter(path, table, metadata={}) as bag:
        for second in seconds:
            bag.write('/often', 100 * NS + round(second * NS), Text())
    return path


def damaged(path):
    """The same bag with a bit changed in every place where messages are."""
    (file,) = path.glob('*.mcap')
    with file.open('rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    content = bytearray(file.read_bytes())
    for chunk in chunks:
        content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0x10
    file.write_bytes(content)
    return path


def range_of(path, duration=0.0, **settings):
    logger = Logger()
    reader = open_bag(path)
    return (
        PlayRange(logger, reader, BagSettings(bag=str(path), **settings), duration),
        reader,
        logger,
    )


@pytest.mark.parametrize('loop', [False, True])
def test_a_range_without_a_message_is_refused_with_start_and_duration(tmp_path, loop):
    path = bag_with(tmp_path / 'bag', range(0, 20, 5))
    play_range, *_ = range_of(path, start=6.0, duration=2.0, loop=loop)
    expected = 'parameters start and duration: .*bag holds no message from 6.000 to 8.000 s; give'
    with pytest.raises(ConfigurationError, match=expected):
        play_range.require(NAMES, 'message')
    play_range, *_ = range_of(path, start=6.0, duration=5.0)
    play_range.require(NAMES, 'message')


def test_a_bag_of_which_nothing_can_be_read_is_an_error_of_the_bag(tmp_path):
    play_range, *_ = range_of(damaged(bag_with(tmp_path / 'bag', SHORT)), start=0.1)
    expected = (
        r'bag: no frame can be read from 0.100 to 0.400 s \(at least 3 messages are lost\); play'
    )
    with pytest.raises(RecordingError, match=expected):
        play_range.require(NAMES, 'frame')


def test_a_bag_without_a_topic_that_can_be_played_is_an_error_of_the_bag(tmp_path):
    play_range, *_ = range_of(bag_with(tmp_path / 'bag', SHORT), start=0.1)
    with pytest.raises(RecordingError, match='none of its topics can be played'):
        play_range.require([], 'message')


def test_what_is_lost_is_logged_once_after_the_pass_in_which_it_was_found(tmp_path):
    path = damaged(bag_with(tmp_path / 'bag', SHORT))
    play_range, reader, logger = range_of(path, loop=True)
    lines = []
    for begin_ns in itertools.islice(play_range.starts(100 * NS + 1), 4):
        lines.append((begin_ns - 100 * NS, len(logger.lines)))
        assert not list(reader.messages(NAMES, begin_ns, play_range.last_ns))
    said = len(logger.lines)
    assert lines == [(1, 0), (0, said), (0, said), (0, said)]
    assert sum('at least 3 messages are lost' in line for line in logger.lines) == 1


def test_without_a_loop_there_is_one_pass_and_what_is_lost_is_logged_after_it(tmp_path):
    play_range, reader, logger = range_of(damaged(bag_with(tmp_path / 'bag', SHORT)))
    for _ in play_range.starts():
        assert not list(reader.messages(NAMES, play_range.first_ns, play_range.last_ns))
        assert not logger.lines
    assert sum('at least 3 messages are lost' in line for line in logger.lines) == 1


def test_an_end_as_it_is_shown_is_in_the_range(tmp_path):
    play_range, *_ = range_of(
        bag_with(tmp_path / 'bag', (0.0, 0.1234567, 22.4666667)), start=0.1234567
    )
    assert play_range.description == '0.123 to 22.467 s'
    assert play_range.stamp_at(0.123) == play_range.first_ns
    assert play_range.stamp_at(22.467) == play_range.stamp_at(22.4667) == play_range.last_ns
    assert play_range.stamp_at(5) == 105 * NS
    assert play_range.stamp_at(0.12) is None
    assert play_range.stamp_at(22.47) is None
