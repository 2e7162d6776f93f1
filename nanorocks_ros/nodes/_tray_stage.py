"""What the nodes behind the tray images share: one stage per tray, results as they come."""

from __future__ import annotations

from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.experiment.settings import PipelineSettings
from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.nodes._shell import tray_image
from nanorocks_ros.recordings.images import frame_from_image
from nanorocks_ros.stages.pipeline import trays_of
from nanorocks_ros.stages.warm_up import warm_up_counting
from nanorocks_ros.wire import topics


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
    """

    def __init__(self, name, stage, outputs):
        super().__init__(name)
        self._make = stage
        self._settings = self.declare(PipelineSettings(), fixed=False)
        self._epoch = Epoch(self, may_set=False)
        warm_up_counting()
        self._adopt(self._settings, self._build(self._settings))
        self.react_to_parameters(PipelineSettings(), self._build, self._adopt)
        for tray in self._settings.trays:
            self.offer(outputs, tray)
            self.listen(topics.GRAY, lambda message, tray=tray: self._take(message, tray), tray)

    def _build(self, settings):
        settings = calibrated(settings)
        return {number: self._make(settings, one) for number, one in trays_of(settings).items()}

    def _adopt(self, settings, stages):
        self._settings, self._stages = settings, stages

    def _take(self, message, tray):
        frame = frame_from_image(message, self.resolve_topic_name(topics.GRAY.of(tray)))
        self._epoch.when_known(frame.stamp_ns, self._push, tray_image(frame, tray))

    def _push(self, image):
        stage = self._stages[image.tray]
        self.prepare(stage, image.tray)
        for record in stage.push(image):
            self.publish_result(record, self._epoch.ns)

    def prepare(self, stage, tray):
        """Tell the stage which pictures somebody wants to see."""
