"""Where the frames of the pipeline node come from: a camera topic, a simulated tray, or a bag.

Tested by ``test/nodes/test_pipeline.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.sources.bag_source import open_bag_frames, recorded_moments
from nanorocks_ros.nodes.sources.camera_subscription import CameraSubscription
from nanorocks_ros.nodes.sources.play_range import PlayRange
from nanorocks_ros.nodes.sources.player import Player
from nanorocks_ros.nodes.sources.simulated_tray import SimulatedTray, publish_frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from nanorocks_ros import settings as st
    from nanorocks_ros.nodes.base.epoch import Epoch
    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.nodes.frames.frame_stages import FrameStages
    from nanorocks_ros.nodes.sources.simulated_tray import TrayMoment
    from nanorocks_ros.nodes.workers.graph_recorder import GraphRecorder
    from nanorocks_ros.recordings.bag.reader import BagMessage
    from nanorocks_ros.records import Frame
    from nanorocks_ros.studies.analysis.bag_frames import BagFrames


class SourceChoice(NamedTuple):
    """The parameters of all sources, and which of them is used."""

    name: str
    bag: st.BagSettings
    simulation: st.SimulationSettings
    camera: st.CameraSettings
    pacing: st.PacingSettings

    @property
    def as_fast_as_possible(self) -> bool:
        """Whether frames come as fast as they are processed."""
        return self.name != 'topic' and self.pacing.rate == 0.0


class FrameSource:
    """Records each frame, and pushes it through the stages.

    Parameters
    ----------
    node : NanorocksNode
    choice : SourceChoice
    epoch : Epoch
    stages : FrameStages
    finished : callable
        Called once after the last frame of a source that ends.

    Attributes
    ----------
    recorder : GraphRecorder or None
        Gets the frames from now on, with the epoch and the camera_info.
    """

    def __init__(
        self,
        node: NanorocksNode,
        choice: SourceChoice,
        epoch: Epoch,
        stages: FrameStages,
        finished: Callable[[], None],
    ) -> None:
        self._node, self._choice, self._epoch = node, choice, epoch
        self._stages, self._finished = stages, finished
        self._bag: BagFrames | None = None
        self.recorder: GraphRecorder | None = None
        if choice.name == 'topic':
            self._subscribe(choice.camera)
        elif choice.name == 'simulator':
            self._play_simulated(choice.simulation)
        else:
            self._play_recorded(choice.bag)

    def record_with(self, recorder: GraphRecorder) -> None:
        """Record from now on, what is known of the camera first."""
        self.recorder = recorder
        if self._bag is not None and (camera_info := self._bag.lens_message()) is not None:
            recorder.record_camera_info(camera_info)

    def _subscribe(self, settings: st.CameraSettings) -> None:
        def on_frame(frame: Frame) -> None:
            self._record(frame, camera.message)
            self._epoch.when_known(frame.stamp_ns, self._push, frame)

        def on_view() -> None:
            self._stages.drain()
            if self.recorder is not None:
                self.recorder.record_camera_info(camera.camera_info)
            self._stages.look_through(camera.topic, camera.view)

        calibrated_by_file = bool(self._stages.settings.preprocess.calibration)
        camera = CameraSubscription(
            self._node, settings, on_frame, None if calibrated_by_file else on_view
        )
        self._stages.look_through(camera.topic)

    def _play_simulated(self, simulation: st.SimulationSettings) -> None:
        source = SimulatedTray(self._node, simulation, self._stages.settings.trays_file)

        def emit(_: int, moment: TrayMoment) -> None:
            frame, truth = source.stamped(moment)
            self._emit_frame(frame)
            self._node.outputs.publish_result(truth, self._epoch.ns)
            self._node.diagnostics.process(self._push, frame)

        self._player = Player(
            self._node, source.moments(), emit, self._choice.pacing, self._finished
        )

    def _play_recorded(self, settings: st.BagSettings) -> None:
        bag = open_bag_frames(settings)
        play_range = PlayRange(self._node, bag.reader, settings, self._choice.pacing.duration)
        play_range.require([bag.topic], 'frame')
        self._stages.look_through(bag.where, bag.view())
        self._bag = bag
        epoch_ns = bag.epoch_ns()
        if epoch_ns is not None:
            self._epoch.set(epoch_ns)

        def emit(_: int, moment: tuple[Frame | FrameError, BagMessage]) -> None:
            frame, message = moment
            if isinstance(frame, FrameError):
                self._node.diagnostics.refuse(frame)
                return
            self._emit_frame(frame, message)
            self._node.diagnostics.process(self._push, frame)

        # The range has the duration already.
        pacing = replace(self._choice.pacing, duration=0.0)
        moments = recorded_moments(bag, play_range)
        self._player = Player(self._node, moments, emit, pacing, self._finished)

    def _emit_frame(self, frame: Frame, message: BagMessage | None = None) -> None:
        """Set the epoch with the first frame; record and publish the frame."""
        if not self._epoch.is_known:
            self._epoch.set(frame.stamp_ns)
        self._record(frame, message)
        publish_frame(self._node, frame)

    def _record(self, frame: Frame, message: object) -> None:
        if self.recorder is not None:
            self.recorder.record_frame(frame, message)

    def _push(self, frame: Frame) -> None:
        if self.recorder is not None:
            self.recorder.record_epoch(self._epoch.ns)
        self._stages.push(frame)
