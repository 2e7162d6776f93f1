"""Node: camera frames in, straight and steady tray images out."""

from __future__ import annotations

from nanorocks_ros.nodes._camera import Camera
from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.warm_up import warm_up
from nanorocks_ros.settings import CameraSettings, PipelineSettings
from nanorocks_ros.stages.preprocess.preprocessor import Preprocessor
from nanorocks_ros.wire import topics


class PreprocessorNode(NanorocksNode):
    """Crops each tray out of the camera's frames and publishes it."""

    def __init__(self):
        super().__init__('preprocessor')
        self._settings = self.declare(PipelineSettings(), fixed=False)
        for tray in self._settings.trays:
            self.offer((topics.STATE, topics.GRAY, topics.RECTIFIED), tray)
        # Others find the publishers meanwhile, and no frame is waiting yet.
        warm_up()
        look = None if self._settings.preprocess.calibration else self._straighten
        self._camera = Camera(self, self.declare(CameraSettings()), self._take, look)
        self._epoch = Epoch(self, may_set=True)
        self._adopt(self._settings, self._build(self._settings))
        self.react_to_parameters(PipelineSettings(), self._build, self._adopt)

    def _build(self, settings):
        camera = self._camera
        return Preprocessor(settings, trays_of(settings), camera.topic, camera.view)

    def _straighten(self):
        self._stage = self._build(self._settings)

    def _adopt(self, settings, stage):
        self._settings, self._stage = settings, stage

    def _take(self, frame):
        self._epoch.when_known(frame.stamp_ns, self._push, frame)

    def _push(self, frame):
        for record in self._stage.push(frame):
            self.publish_result(record, self._epoch.ns)
