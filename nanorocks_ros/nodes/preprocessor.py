"""Node: camera frames in, straight and steady tray images out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.nodes.base.communication.topic_monitor import ONE_SOURCE
from nanorocks_ros.nodes.base.epoch import Epoch
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.base.parameters import ALL_RESET, CYCLE_GOES_ON
from nanorocks_ros.nodes.base.told_settings import default_settings
from nanorocks_ros.nodes.sources.camera_subscription import CameraSubscription
from nanorocks_ros.pipeline.changed_settings import Part, changed_parts
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.warm_up import warm_up
from nanorocks_ros.settings import CameraSettings, PipelineSettings
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from nanorocks_ros.records import Frame


class PreprocessorNode(NanorocksNode):
    """Crops each tray out of the camera's frames and publishes it."""

    def __init__(self) -> None:
        super().__init__('preprocessor')
        self._settings = self.parameters.declare(default_settings(self), read_only=False)
        for tray in self._settings.trays:
            self.outputs.offer((topics.STATE, topics.GRAY, topics.RECTIFIED), tray)
            self.topic_monitor.require_single_publisher(topics.STATE.of(tray), ONE_SOURCE)
        # Meanwhile others discover the publishers, and no frame is waiting yet.
        warm_up()
        on_view = None if self._settings.preprocess.calibration else self._rebuild
        camera = self.parameters.declare(CameraSettings())
        self._camera = CameraSubscription(self, camera, self._receive, on_view)
        self._epoch = Epoch(self, may_set=True)
        self._stage = self._build(self._settings)
        self.parameters.react_to_changes(self._settings, self._build, self._change)

    def _build(self, settings: PipelineSettings) -> Preprocessor:
        camera = self._camera
        return Preprocessor(settings, trays_of(settings), camera.topic, camera.view)

    def _rebuild(self) -> None:
        self._stage = self._build(self._settings)

    def _change(
        self, before: PipelineSettings, after: PipelineSettings, stage: Preprocessor
    ) -> str:
        self._settings = after
        if Part.IMAGES not in changed_parts(before, after):
            return CYCLE_GOES_ON
        self._stage = stage
        return ALL_RESET

    def _receive(self, frame: Frame) -> None:
        self._epoch.when_known(frame.stamp_ns, self._push, frame)

    def _push(self, frame: Frame) -> None:
        for record in self._stage.push(frame):
            self.outputs.publish_result(record, self._epoch.ns)
