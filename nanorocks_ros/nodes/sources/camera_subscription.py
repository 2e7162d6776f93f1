"""Subscribes to the camera, raw or compressed, and to its camera_info."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from rclpy.event_handler import SubscriptionEventCallbacks
from sensor_msgs.msg import CameraInfo

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.nodes.base.frame_acknowledgement import FrameAcknowledgement
from nanorocks_ros.nodes.base.problems import Level, Problem, Silence
from nanorocks_ros.nodes.sources.dropped_frames import DroppedFrames
from nanorocks_ros.recordings.messages.camera_info import info_from_message, view_from_message
from nanorocks_ros.recordings.messages.image_messages import (
    frame_from_compressed,
    frame_from_image,
    stamp_ns_of,
)
from nanorocks_ros.recordings.stamp_check import StampCheck
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable

    from sensor_msgs.msg import CompressedImage, Image

    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.records import Frame
    from nanorocks_ros.settings import CameraSettings

# Frames that are held back for a camera_info that somebody publishes, but has not sent yet.
_PATIENCE_FRAMES = 30
# A frame with a far stamp that waits for the next one is passed on when none comes, [s].
_NEXT_FRAME_S = 1.0


class CameraSubscription:
    """Subscribes to the camera and passes each frame on.

    Parameters
    ----------
    node : NanorocksNode
    settings : CameraSettings
    on_frame : callable
        Called with each Frame; `message` is the message that it came in.
    on_view : callable, optional
        Called when `view` becomes known or changes. Default: do not subscribe to camera_info.

    Attributes
    ----------
    view : View or None
        Of the last camera_info.
    message, camera_info : sensor_msgs messages or None
        The last image that was passed on, and the last camera_info that was used.
    topic : str
        Full name.
    """

    def __init__(
        self,
        node: NanorocksNode,
        settings: CameraSettings,
        on_frame: Callable[[Frame], None],
        on_view: Callable[[], None] | None = None,
    ) -> None:
        compressed = settings.transport == 'compressed'
        topic = topics.RAW_COMPRESSED if compressed else topics.RAW
        self._read = frame_from_compressed if compressed else frame_from_image
        self._node, self._on_frame, self._on_view = node, on_frame, on_view
        self._info: object = None
        self._refusal: FrameError | None = None
        self._held: list[Image | CompressedImage] = []
        self._last_frame: Frame | None = None
        self._started = False
        self._dropped = DroppedFrames()
        self.view: View | None = None
        self.camera_info: CameraInfo | None = None
        self.message: Image | CompressedImage | None = None
        self.topic = node.resolve_topic_name(topic.name)
        self._stamps: StampCheck[Image | CompressedImage] = StampCheck(self.topic)
        self._heard_at = 0.0
        self._info_topic = node.resolve_topic_name(topics.CAMERA_INFO.name)
        if on_view is not None:
            self._subscribe_to_camera_info()
        node.topic_monitor.require_single_publisher(topic.name)
        self._silence = Silence(self.topic)
        self._acknowledgement = FrameAcknowledgement(node, [node.listen(topic, self._receive)])
        node.create_timer(_NEXT_FRAME_S, self._release_last, clock=node.steady_clock)
        node.diagnostics.watched += [
            lambda: self._silence.problem(node.count_publishers(self.topic)),
            self._other_camera,
        ]

    def _subscribe_to_camera_info(self) -> None:
        # Ours is latched; drivers send one with each frame and do not keep it.
        for latched in (True, False):
            self._node.create_subscription(
                CameraInfo,
                topics.CAMERA_INFO.name,
                self._receive_camera_info,
                qos_of(replace(topics.CAMERA_INFO, latched=latched)),
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            )

    def _receive_camera_info(self, message: CameraInfo) -> None:
        info = info_from_message(message)
        if info == self._info:
            return
        self._info, self._refusal = info, None
        try:
            self.view = view_from_message(message, self._info_topic)
            self.camera_info = message
        except FrameError as error:
            # Frames that stay distorted would give wrong numbers, so they are refused, too.
            self._refusal = error
            self._node.diagnostics.refuse(error)
            return
        if self._started:
            self._node.get_logger().info(
                f'{self._info_topic}: the camera parameters changed; all stages were reset'
            )
        if self._on_view is not None:
            self._on_view()
        self._release()

    def _receive(self, message: Image | CompressedImage) -> None:
        self._silence.hear()
        self._heard_at = time.monotonic()
        stamp_ns = stamp_ns_of(message)
        try:
            self._take(self._stamps.push(stamp_ns, message))
        finally:
            self._acknowledgement.acknowledge(stamp_ns)

    def _release_last(self) -> None:
        """Pass on a frame that waits for the next one, when none comes."""
        if time.monotonic() - self._heard_at >= _NEXT_FRAME_S:
            self._take(self._stamps.release())

    def _take(self, decided: list[tuple[Image | CompressedImage, FrameError | None]]) -> None:
        """Use or refuse each message; one that cannot be used does not keep the others."""
        for message, refusal in decided:
            try:
                if refusal is not None:
                    raise refusal
                self._hold_or_pass_on(message)
            except FrameError as error:
                self._node.diagnostics.refuse(error)

    def _hold_or_pass_on(self, message: Image | CompressedImage) -> None:
        waiting = self._on_view is not None and self._info is None and not self._started
        offered = waiting and self._node.count_publishers(self._info_topic) > 0
        if offered and len(self._held) < _PATIENCE_FRAMES:
            self._held.append(message)
            return
        if waiting:
            self._node.get_logger().info(
                f'{self._info_topic}: no message; the image is assumed to be undistorted'
            )
        self._started = True
        self._release()
        self._pass_on(message)

    def _other_camera(self) -> Problem | None:
        """A warning while the camera_info that is used is of another coordinate frame."""
        if self.camera_info is None or self.message is None:
            return None
        lens, image = self.camera_info.header.frame_id, self.message.header.frame_id
        if not lens or not image or lens == image:
            return None
        return Problem(
            Level.WARN,
            f'{self._info_topic}: frame_id {lens!r}, but the images of {self.topic} have '
            f'{image!r}: is it of another camera? Remap it (-r {self._info_topic}:=/OTHER)',
        )

    def _release(self) -> None:
        """Pass on the frames that were held back."""
        held, self._held = self._held, []
        self._started = self._started or bool(held)
        for message in held:
            self._node.diagnostics.process(self._pass_on, message)

    def _pass_on(self, message: Image | CompressedImage) -> None:
        if self._refusal is not None:
            raise self._refusal
        frame = self._read(message, self.topic)
        if missing := self._dropped.push(frame.stamp_ns):
            self._node.diagnostics.report_missing_frames(self.topic, missing, self._dropped.count)
        # The last frame is kept until the next one is there: otherwise its 6 MB go back to the
        # system each time, and to get them again took as long as decoding.
        self._last_frame, self.message = frame, message
        self._on_frame(frame)
