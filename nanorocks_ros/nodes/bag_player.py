"""Node: a recorded run, published again at the pace it was recorded, with ``/clock``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from nanorocks_ros.errors import ConfigurationError, FrameError, RecordingError
from nanorocks_ros.nodes.base.communication.ros_messages import (
    compressed_message,
    image_message,
    time_message,
)
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.sources.bag_publishers import BagPublishers, stamp_in
from nanorocks_ros.nodes.sources.bag_source import path_of_bag
from nanorocks_ros.nodes.sources.play_range import PlayRange
from nanorocks_ros.nodes.sources.player import Player
from nanorocks_ros.nodes.sources.player_services import PlayerServices
from nanorocks_ros.recordings.bag.played_range import latched_messages
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.messages.image_messages import (
    frame_from_compressed,
    frame_from_image,
    frame_to_jpeg,
)
from nanorocks_ros.settings import BagSettings, PacingSettings, PlayerSettings, rows
from nanorocks_ros.settings import problem as setting_problem
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rclpy.parameter import Parameter

    from nanorocks_ros.recordings.bag.reader import BagMessage

_CLOCK_S = 0.025
_JPEG_QUALITY = 95
_RAW, _COMPRESSED = topics.RAW.absolute(), topics.RAW_COMPRESSED.absolute()
_ONE_CLOCK = (
    'stop all but one, or give each a clock of its own (-r /clock:=/NAME/clock, also for the '
    'nodes that use it)'
)
_RESULTS_TWICE = 'set results:=false for bag_player, or stop the other node'


class BagPlayerNode(NanorocksNode):
    """Plays a bag; topics under ``/nanorocks`` move with the node's own namespace."""

    def __init__(self) -> None:
        super().__init__('bag_player')
        settings = self.parameters.declare(BagSettings())
        playback = self.parameters.declare(PlayerSettings(), read_only=False)
        pacing = self.parameters.declare(PacingSettings(), read_only=False)
        self.parameters.refuse_unknown()
        self._reader = open_bag(path_of_bag(settings))
        self._reader.require_topic(list(self._reader.topics))
        self._range = PlayRange(self, self._reader, settings, pacing.duration)
        self._last_decoded: object = None
        self._clock_ns: int | None = None
        self._clock_publisher = self.create_publisher(Clock, '/clock', QoSProfile(depth=10))
        self._publishers_of_bag = BagPublishers(self, self._reader, with_results=playback.results)
        self._range.require(self._publishers_of_bag.names, 'message')
        self._range.log_damage()
        self._camera = [name for name in (_RAW, _COMPRESSED) if self._has_messages(name)]
        self._epoch_ns = BagFrames(self._reader.path).epoch_ns() if self._camera else None
        self._require_single_publishers()
        begin_ns = self._begin_ns(playback.position)
        self._publish_latched(begin_ns)
        # The range has the duration already.
        pacing = replace(pacing, duration=0.0)
        self._player = Player(self, self._moments(begin_ns), self._emit, pacing, self.finish)
        if playback.paused:
            self._player.pause()
        self.create_timer(_CLOCK_S, self._publish_clock, clock=self.steady_clock)
        PlayerServices(self, self._player, self._range, self._is_step)
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._apply_change)

    def _begin_ns(self, position: float) -> int:
        # The default is 0, and the range may begin later.
        if position == 0.0:
            return self._range.first_ns
        stamp_ns = self._range.stamp_at(position)
        if stamp_ns is None:
            raise ConfigurationError(
                'parameter position', self._outside_range(position), 'give another'
            )
        return stamp_ns

    def _has_messages(self, name: str) -> bool:
        return name in self._publishers_of_bag.names and self._reader.topics[name].count > 0

    def _require_single_publishers(self) -> None:
        self.topic_monitor.require_single_publisher('/clock', _ONE_CLOCK)
        for topic in (topics.RAW, topics.RAW_COMPRESSED):
            self.outputs.offer((topic,))
            self.topic_monitor.require_single_publisher(topic.name)
        for name in self._publishers_of_bag.results:
            self.topic_monitor.require_single_publisher(name, _RESULTS_TWICE)

    # Playback

    def _moments(self, first_ns: int) -> Iterator[tuple[int, BagMessage | None]]:
        """Log time and message; between two passes of a loop the start and None."""
        names, last_ns = self._publishers_of_bag.names, self._range.last_ns
        for number, begin_ns in enumerate(self._range.starts(first_ns)):
            if number > 0:
                yield begin_ns, None
            for message in self._reader.messages(names, begin_ns, last_ns):
                yield message.log_time_ns, message

    def _emit(self, stamp_ns: int, message: BagMessage | None) -> None:
        self._publish_clock(stamp_ns)
        if message is None:
            self._publish_latched(stamp_ns)
            return
        if message.topic not in self._camera:
            self._publishers_of_bag.send(message)
            return
        try:
            self._send_frame(message)
        except FrameError as error:
            self.diagnostics.refuse(error)

    def _send_frame(self, message: BagMessage) -> None:
        stamp_ns = stamp_in(message)
        self._publishers_of_bag.send(message)
        self._player.flow_control.note_sent(stamp_ns)
        # The camera is also published in the other form, if somebody subscribes to that.
        if self._camera == [_COMPRESSED] and self.outputs.has_subscribers(topics.RAW):
            self.diagnostics.process(self._send_decoded, message)
        if self._camera == [_RAW] and self.outputs.has_subscribers(topics.RAW_COMPRESSED):
            self.diagnostics.process(self._send_encoded, message)

    def _deserialized(self, message: BagMessage) -> Any:
        try:
            return self._reader.deserialize(message)
        except RecordingError as error:
            # A damaged message is refused like a frame, and the others are played.
            raise FrameError(error.where, error.what, error.do) from error

    def _send_decoded(self, message: BagMessage) -> None:
        frame = frame_from_compressed(self._deserialized(message), message.topic)
        image = image_message(frame.stamp_ns, 'camera', frame.image)
        self.outputs.send(topics.RAW, image)
        # Kept until the next one is there: see CameraSubscription.
        self._last_decoded = frame, image

    def _send_encoded(self, message: BagMessage) -> None:
        frame = frame_from_image(self._deserialized(message), message.topic)
        jpeg = frame_to_jpeg(frame, _JPEG_QUALITY)
        image = compressed_message(frame.stamp_ns, 'camera', jpeg)
        self.outputs.send(topics.RAW_COMPRESSED, image)

    def _publish_latched(self, stamp_ns: int) -> None:
        """Publish the last messages of latched topics before a time."""
        if self._epoch_ns is not None:
            self.outputs.send(topics.EPOCH, time_message(self._epoch_ns))
        for message in latched_messages(self._reader, self._publishers_of_bag.latched, stamp_ns):
            self._publishers_of_bag.send(message)

    def _publish_clock(self, stamp_ns: int | None = None) -> None:
        """Publish the clock: by the timer, and for each message of a new time."""
        now_ns = self._player.now_ns if stamp_ns is None else stamp_ns
        if stamp_ns is None or stamp_ns != self._clock_ns:
            self._clock_publisher.publish(Clock(clock=time_message(now_ns)))
        self._clock_ns = now_ns
        self.diagnostics.values['position [s]'] = f'{self._range.seconds(now_ns):.3f}'
        self.diagnostics.values['paused'] = str(self._player.paused).lower()

    def _is_step(self, message: BagMessage | None) -> bool:
        """Whether a message is a frame, or any message of a bag without frames."""
        return message is not None and (not self._camera or message.topic in self._camera)

    # Parameters

    def _check_change(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            problem = self._problem_with(parameter.name, parameter.value)
            if problem is not None:
                reason = f'{parameter.name}: {problem}'
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _problem_with(self, name: str, value: Any) -> str | None:
        """Why a parameter cannot have a value now; None when it can, or is no setting."""
        settings = {row.name: row for row in (*rows(PlayerSettings()), *rows(PacingSettings()))}
        if name not in settings:
            return None
        problem = setting_problem(settings[name], value)
        if problem is not None or name == 'rate':
            return problem
        if name != 'position':
            return 'can only be set at the start'
        return self._outside_range(value) if self._range.stamp_at(value) is None else None

    def _outside_range(self, seconds: float) -> str:
        return f'{seconds:g} s is outside the range that is played, {self._range.description}'

    def _apply_change(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == 'rate':
                self._player.set_rate(float(parameter.value))
            if parameter.name == 'position':
                stamp_ns = self._range.stamp_at(parameter.value)
                if stamp_ns is not None:
                    self._seek(stamp_ns)

    def _seek(self, stamp_ns: int) -> None:
        self._player.seek(self._moments(stamp_ns), stamp_ns)
        self._publish_clock(stamp_ns)
        self._publish_latched(stamp_ns)
        self.get_logger().info(f'moved to {self._range.seconds(stamp_ns):.3f} s')
