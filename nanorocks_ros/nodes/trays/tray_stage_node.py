"""The base of the nodes behind the tray images: one stage per tray."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import FrameError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.nodes.base.communication.topic_monitor import ONE_SOURCE
from nanorocks_ros.nodes.base.epoch import Epoch
from nanorocks_ros.nodes.base.frame_acknowledgement import FrameAcknowledgement
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.base.parameters import ALL_RESET, CYCLE_GOES_ON
from nanorocks_ros.nodes.base.told_settings import default_settings
from nanorocks_ros.nodes.trays.image_size_check import ImageSizeCheck
from nanorocks_ros.nodes.trays.track_images import TrackImages
from nanorocks_ros.nodes.trays.tray_image_messages import color_frame, gray_frame
from nanorocks_ros.nodes.trays.tray_image_sync import TrayImageSync
from nanorocks_ros.pipeline.changed_settings import Part, changed_parts
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.warm_up import warm_up_counting, warm_up_speed
from nanorocks_ros.records import Tracks, TrayImage, TrayState
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from sensor_msgs.msg import Image
    from std_msgs.msg import Float32MultiArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.wire.topics import Topic


class TrayStageNode(NanorocksNode):
    """Pushes the images of each tray through a stage of its own, and publishes the results.

    Parameters
    ----------
    name : str
        Of the node.
    make_stage : callable
        Makes the stage from PipelineSettings and a Tray.
    outputs : sequence of Topic
        What the node publishes, offered at once: a late offer would lose the first messages.
    part : Part
        That the stage is of.
    in_color : bool
        Whether the stage uses colours.
    """

    def __init__(
        self,
        name: str,
        make_stage: Callable[[PipelineSettings, Tray], Any],
        outputs: Sequence[Topic],
        *,
        part: Part,
        in_color: bool = False,
    ) -> None:
        super().__init__(name)
        self._part = part
        self._in_color = in_color
        self._make_stage = make_stage
        self._settings = self.parameters.declare(default_settings(self), read_only=False)
        self._epoch = Epoch(self, may_set=False)
        for tray in self._settings.trays:
            self.outputs.offer(outputs, tray)
            self.topic_monitor.require_single_publisher(outputs[0].of(tray), ONE_SOURCE)
        # Meanwhile others discover the publishers, and do not miss them.
        warm_up_counting()
        if in_color:
            warm_up_speed()
        self._adopt(self._settings, self._build(self._settings))
        self.parameters.react_to_changes(self._settings, self._build, self._change)
        self._pushed_ns = dict.fromkeys(self._settings.trays, 0)
        self._sync = {tray: TrayImageSync() for tray in self._settings.trays}
        self._subscribe()

    def _subscribe(self) -> None:
        """Subscribe to the inputs of every tray."""
        inputs: dict[Topic, Callable[[int, Any], None]] = {
            topics.GRAY: self._receive_gray,
            topics.STATE: self._receive_state,
        }
        if self._in_color:
            inputs[topics.RECTIFIED] = self._receive_color
        subscriptions = []
        for tray in self._settings.trays:
            subscriptions += [
                self.listen(topic, partial(receive, tray), tray, required=topic == topics.GRAY)
                for topic, receive in inputs.items()
            ]
        self._acknowledgement = FrameAcknowledgement(self, subscriptions)

    def _build(self, settings: PipelineSettings) -> dict[int, Any]:
        settings = calibrated(settings)
        return {
            number: self._make_stage(settings, tray) for number, tray in trays_of(settings).items()
        }

    def _change(
        self, before: PipelineSettings, after: PipelineSettings, stages: dict[int, Any]
    ) -> str:
        if not changed_parts(before, after) & (Part.IMAGES | self._part):
            self._settings = after
            return CYCLE_GOES_ON
        self._adopt(after, stages)
        return ALL_RESET

    def _adopt(self, settings: PipelineSettings, stages: dict[int, Any]) -> None:
        self._settings, self._stages = settings, stages
        self._track_images = TrackImages(self, calibrated(settings).preprocess.pixels_per_metre)
        # The new stages have seen no image yet.
        self._sizes = {tray: ImageSizeCheck(self._gray_topic(tray)) for tray in stages}

    def _gray_topic(self, tray: int) -> str:
        return str(self.resolve_topic_name(topics.GRAY.of(tray)))

    def _receive_gray(self, tray: int, message: Image) -> None:
        frame = gray_frame(message, self._gray_topic(tray))
        if self.count_publishers(topics.STATE.of(tray)) == 0:
            # Crops of another preprocessor, without a state.
            image = TrayImage(stamp_ns=frame.stamp_ns, tray=tray, gray=frame.image)
            self._push_all(frame.stamp_ns, (image,))
            return
        self._push_all(frame.stamp_ns, self._sync[tray].add_gray(frame))

    def _receive_color(self, tray: int, message: Image) -> None:
        frame = color_frame(message, self.resolve_topic_name(topics.RECTIFIED.of(tray)))
        self._push_all(frame.stamp_ns, self._sync[tray].add_color(frame))

    def _receive_state(self, tray: int, message: Float32MultiArray) -> None:
        self._epoch.when_known(None, partial(self._add_state, tray), message)

    def _add_state(self, tray: int, message: Float32MultiArray) -> None:
        where = self.resolve_topic_name(topics.STATE.of(tray))
        state = from_array(
            TrayState, message.data, tray=tray, epoch_ns=self._epoch.ns, where=where
        )
        if not self._in_color:
            state = replace(state, color=0)
        self._push_all(state.stamp_ns, self._sync[tray].add_state(state))

    def _push_all(self, stamp_ns: int, images: Iterable[TrayImage]) -> None:
        for image in images:
            self._epoch.when_known(stamp_ns, self._push, image)
            self._pushed_ns[image.tray] = image.stamp_ns
            # A frame is processed when the images of all its trays are.
            if len(set(self._pushed_ns.values())) == 1:
                self._acknowledgement.acknowledge(image.stamp_ns)

    def _push(self, image: TrayImage) -> None:
        try:
            if self._sizes[image.tray].has_changed(image):
                self._reset(image.tray)
        except FrameError as error:
            # Caught here, since other images that waited for the epoch follow.
            self.diagnostics.refuse(error)
            return
        stage = self._stages[image.tray]
        self.select_images(stage, image.tray)
        for record in stage.push(image):
            if isinstance(record, Tracks):
                self._track_images.publish(image, record)
            else:
                self.outputs.publish_result(record, self._epoch.ns)

    def _reset(self, tray: int) -> None:
        self.get_logger().warning(
            f'{self._gray_topic(tray)}: the image size changed; the stage of the tray was reset'
        )
        self._stages[tray] = self._build(self._settings)[tray]

    def select_images(self, stage: Any, tray: int) -> None:
        """Tell the stage which images to make: those that somebody subscribes to."""
