"""Node: a recorded run, published again at the pace it was recorded, with ``/clock``."""

from __future__ import annotations

from dataclasses import replace

from rcl_interfaces.msg import SetParametersResult
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from nanorocks_ros.errors import ConfigurationError, FrameError, RecordingError
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.nodes._pacing import Pacer
from nanorocks_ros.nodes._part import Part
from nanorocks_ros.nodes._playback import Playback, stamp_in
from nanorocks_ros.nodes._shell import compressed_message, image_message, time_message
from nanorocks_ros.nodes._sources import path_of_bag
from nanorocks_ros.recordings.bag.played_range import latched_messages
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.messages.image_messages import (
    frame_from_compressed,
    frame_from_image,
    frame_to_jpeg,
)
from nanorocks_ros.settings import BagSettings, PacingSettings, PlayerSettings, rows
from nanorocks_ros.settings import problem as wrong_with
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.wire import topics

_CLOCK_S = 0.025
_JPEG_QUALITY = 95
_CAMERA = (topics.RAW.absolute(), topics.RAW_COMPRESSED.absolute())
_ONE_CLOCK = (
    'end all but one, or give each a clock of its own (-r /clock:=/NAME/clock, also for the nodes '
    'that follow it)'
)
_WORK_IT_OUT_AGAIN = 'set results:=false for bag_player, or end the other'


class BagPlayerNode(NanorocksNode):
    """Plays a bag; topics under ``/nanorocks`` move with the node's own namespace."""

    def __init__(self):
        super().__init__('bag_player')
        settings = self.declare(BagSettings())
        player = self.declare(PlayerSettings(), fixed=False)
        pacing = self.declare(PacingSettings(), fixed=False)
        self.refuse_unknown_parameters()
        self._reader = open_bag(path_of_bag(settings))
        self._reader.require_topic(list(self._reader.topics))
        self._part = Part(self, self._reader, settings, pacing.duration)
        self._last = None
        self._clock_ns = None
        self._clock_output = self.create_publisher(Clock, '/clock', QoSProfile(depth=10))
        self._playback = Playback(self, self._reader, player.results)
        self._part.require(self._playback.names, 'message')
        self._part.tell_missing()
        self._camera = [name for name in _CAMERA if self._has_messages(name)]
        self._epoch_ns = BagFrames(self._reader.path).epoch_ns() if self._camera else None
        self._expect_to_be_alone()
        begin_ns = self._begin_ns(player.position)
        self._tell_latched(begin_ns)
        self._pacer = Pacer(
            self,
            self._moments(begin_ns),
            self._emit,
            replace(pacing, duration=0.0),
            self.finish,
            player.paused,
        )
        self.create_timer(_CLOCK_S, self._tell_time, clock=self.steady_clock)
        self._take_orders()

    def _begin_ns(self, position):
        # Its default is no order: the part may begin later.
        if position == 0.0:
            return self._part.first_ns
        if self._part.stamp_at(position) is None:
            raise ConfigurationError(
                'parameter position', self._wrong_with_position(position), 'give another'
            )
        return self._part.stamp_at(position)

    def _has_messages(self, name):
        return name in self._playback.names and self._reader.topics[name].count > 0

    def _expect_to_be_alone(self):
        self.watch.alone_on('/clock', _ONE_CLOCK)
        for topic in (topics.RAW, topics.RAW_COMPRESSED):
            self.offer((topic,))
            self.watch.alone_on(topic.name)
        for name in self._playback.results:
            self.watch.alone_on(name, _WORK_IT_OUT_AGAIN)

    # What is played

    def _moments(self, first_ns):
        names, last_ns = self._playback.names, self._part.last_ns
        for turn, begin_ns in enumerate(self._part.turns(first_ns)):
            if turn > 0:
                # Between the last message and the first.
                yield begin_ns, None
            for message in self._reader.messages(names, begin_ns, last_ns):
                yield message.log_time_ns, message

    def _emit(self, stamp_ns, message):
        self._tell_time(stamp_ns)
        if message is None:
            self._tell_latched(stamp_ns)
            return
        if message.topic not in self._camera:
            self._playback.send(message)
            return
        try:
            self._send_frame(message)
        except FrameError as error:
            self.refuse(error)

    def _send_frame(self, message):
        stamp_ns = stamp_in(message)
        self._playback.send(message)
        self._pacer.takers.sent(stamp_ns)
        # Who asks for the camera in the other form gets it.
        if self._camera == [_CAMERA[1]] and self.wanted(topics.RAW):
            self.timed(self._decoded, message)
        if self._camera == [_CAMERA[0]] and self.wanted(topics.RAW_COMPRESSED):
            self.timed(self._encoded, message)

    def _content(self, message):
        try:
            return self._reader.deserialize(message)
        except RecordingError as error:
            # One of many: the others are played.
            raise FrameError(error.where, error.what, error.do) from error

    def _decoded(self, message):
        frame = frame_from_compressed(self._content(message), message.topic)
        image = image_message(frame.stamp_ns, 'camera', frame.image)
        self.send(topics.RAW, image)
        # Let go only when there is the next one, see _camera.py.
        self._last = frame, image

    def _encoded(self, message):
        frame = frame_from_image(self._content(message), message.topic)
        jpeg = frame_to_jpeg(frame, _JPEG_QUALITY)
        self.send(topics.RAW_COMPRESSED, compressed_message(frame.stamp_ns, 'camera', jpeg))

    def _tell_latched(self, stamp_ns):
        """Publish what latched topics held at a time."""
        if self._epoch_ns is not None:
            self.send(topics.EPOCH, time_message(self._epoch_ns))
        for message in latched_messages(self._reader, self._playback.latched, stamp_ns):
            self._playback.send(message)

    def _tell_time(self, stamp_ns=None):
        """Publish the clock: steadily, and whenever a message moves it on."""
        now_ns = self._pacer.now_ns if stamp_ns is None else stamp_ns
        if stamp_ns is None or stamp_ns != self._clock_ns:
            self._clock_output.publish(Clock(clock=time_message(now_ns)))
        self._clock_ns = now_ns
        self.state['position [s]'] = f'{self._part.seconds(now_ns):.3f}'
        self.state['paused'] = str(self._pacer.paused).lower()

    # What it is told to do

    def _take_orders(self):
        orders = {
            'pause': self._pause,
            'resume': self._resume,
            'toggle_paused': self._toggle,
            'is_paused': self._tell_paused,
            'play_next': self._play_next,
        }
        for name, order in orders.items():
            self.create_service(Trigger, f'~/{name}', order)
        self.add_on_set_parameters_callback(self._check)
        self.add_post_set_parameters_callback(self._changed)

    def _answer(self, response, success=True):
        response.success = success
        where = f'{self._part.seconds(self._pacer.now_ns):.3f} s'
        response.message = f'{"paused" if self._pacer.paused else "playing"} at {where}'
        return response

    def _pause(self, _, response):
        self._pacer.pause()
        return self._answer(response)

    def _resume(self, _, response):
        self._pacer.resume()
        return self._answer(response)

    def _toggle(self, request, response):
        turn = self._resume if self._pacer.paused else self._pause
        return turn(request, response)

    def _tell_paused(self, _, response):
        return self._answer(response, self._pacer.paused)

    def _play_next(self, _, response):
        """Play up to the next frame of the camera, or the next message where there is none."""
        if not self._pacer.paused:
            response.message = 'playing; pause first'
            return response
        held = self._camera
        found = self._pacer.step(lambda m: m is not None and (not held or m.topic in held))
        return self._answer(response, found)

    def _check(self, parameters):
        known = {row.name: row for row in (*rows(PlayerSettings()), *rows(PacingSettings()))}
        for parameter in parameters:
            text = (
                wrong_with(known[parameter.name], parameter.value)
                if parameter.name in known
                else None
            )
            if text is None and parameter.name == 'position':
                text = self._wrong_with_position(parameter.value)
            if (
                text is None
                and parameter.name in known
                and parameter.name not in ('rate', 'position')
            ):
                text = 'takes effect at the start only'
            if text is not None:
                return SetParametersResult(successful=False, reason=f'{parameter.name}: {text}')
        return SetParametersResult(successful=True)

    def _wrong_with_position(self, seconds):
        if self._part.stamp_at(seconds) is None:
            return f'{seconds:g} s is not in the part that is played, {self._part.where}'
        return None

    def _changed(self, parameters):
        for parameter in parameters:
            if parameter.name == 'rate':
                self._pacer.set_rate(float(parameter.value))
            if parameter.name == 'position':
                self._seek(self._part.stamp_at(parameter.value))

    def _seek(self, stamp_ns):
        self._pacer.restart(self._moments(stamp_ns), stamp_ns)
        self._tell_time(stamp_ns)
        self._tell_latched(stamp_ns)
        self.get_logger().info(f'went to {self._part.seconds(stamp_ns):.3f} s')
