"""What the nodes behind the tray images share: one stage per tray, results as they come."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from nanorocks_ros.errors import FrameError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.nodes._crops import OneSize, color_frame, gray_frame
from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._join import TrayJoiner
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.nodes._tracks import TracksPicture
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.warm_up import warm_up_counting, warm_up_speed
from nanorocks_ros.records import Tracks, TrayImage, TrayState
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array


class TrayStageNode(NanorocksNode):
    """Pushes the gray images of each tray through a stage of its own.

    Parameters
    ----------
    name : str
        Of the node.
    stage : callable
        Makes the stage from the settings and a Tray.
    outputs : tuple of Topic
        What it publishes, offered at once: a late offer would lose the first messages.
    in_color : bool
        Whether the stage looks at colours.
    """

    def __init__(self, name, stage, outputs, in_color=False):
        super().__init__(name)
        inputs = {topics.GRAY: self._take_gray, topics.STATE: self._take_state}
        if in_color:
            inputs[topics.RECTIFIED] = self._take_color
        self._in_color = in_color
        self._make = stage
        self._settings = self.declare(PipelineSettings(), fixed=False)
        self._epoch = Epoch(self, may_set=False)
        warm_up_counting()
        if in_color:
            warm_up_speed()
        self._adopt(self._settings, self._build(self._settings))
        self.react_to_parameters(PipelineSettings(), self._build, self._adopt)
        self._joined_ns = dict.fromkeys(self._settings.trays, 0)
        self._joiners = {tray: TrayJoiner(tray) for tray in self._settings.trays}
        subscriptions = []
        for tray in self._settings.trays:
            self.offer(outputs, tray)
            subscriptions += [
                self.listen(topic, partial(take, tray), tray, required=topic == topics.GRAY)
                for topic, take in inputs.items()
            ]
        self.tell_what_is_taken(subscriptions)

    def _build(self, settings):
        settings = calibrated(settings)
        return {number: self._make(settings, tray) for number, tray in trays_of(settings).items()}

    def _adopt(self, settings, stages):
        self._settings, self._stages = settings, stages
        self._picture = TracksPicture(self, calibrated(settings).preprocess.pixels_per_metre)
        # Stages that are new know of no size yet.
        self._sizes = {
            tray: OneSize(self.resolve_topic_name(topics.GRAY.of(tray))) for tray in stages
        }

    def _take_gray(self, tray, message):
        frame = gray_frame(message, self.resolve_topic_name(topics.GRAY.of(tray)))
        if self.count_publishers(topics.STATE.of(tray)) == 0:
            # Somebody's own crops, of which nothing more is known.
            image = TrayImage(stamp_ns=frame.stamp_ns, tray=tray, gray=frame.image)
            self._push_all(frame.stamp_ns, (image,))
            return
        self._push_all(frame.stamp_ns, self._joiners[tray].gray(frame))

    def _take_color(self, tray, message):
        frame = color_frame(message, self.resolve_topic_name(topics.RECTIFIED.of(tray)))
        self._push_all(frame.stamp_ns, self._joiners[tray].color(frame))

    def _take_state(self, tray, message):
        self._epoch.when_known(None, partial(self._join_state, tray), message)

    def _join_state(self, tray, message):
        where = self.resolve_topic_name(topics.STATE.of(tray))
        state = from_array(
            TrayState, message.data, tray=tray, epoch_ns=self._epoch.ns, where=where
        )
        if not self._in_color:
            state = replace(state, color=0)
        self._push_all(state.stamp_ns, self._joiners[tray].state(state, self._epoch.ns))

    def _push_all(self, stamp_ns, images):
        for image in images:
            self._epoch.when_known(stamp_ns, self._push, image)
            self._joined_ns[image.tray] = image.stamp_ns
            # Done with a frame is who is done with all its trays.
            if len(set(self._joined_ns.values())) == 1:
                self.taken(image.stamp_ns)

    def _push(self, image):
        try:
            if self._sizes[image.tray].changed(image):
                self._start_afresh(image.tray)
        except FrameError as error:
            # Here, so that what waits behind it for the epoch is not lost with it.
            self.refuse(error)
            return
        stage = self._stages[image.tray]
        self.prepare(stage, image.tray)
        for record in stage.push(image):
            if isinstance(record, Tracks):
                self._picture.send(image, record)
            else:
                self.publish_result(record, self._epoch.ns)

    def _start_afresh(self, tray):
        where = self.resolve_topic_name(topics.GRAY.of(tray))
        self.get_logger().warning(f'{where}: pictures of another size; starting afresh')
        self._stages[tray] = self._build(self._settings)[tray]

    def prepare(self, stage, tray):
        """Tell the stage which pictures somebody wants to see."""
