"""Node: the whole data path in one process, from a simulator, a bag or a camera topic."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from nanorocks_ros import settings as st
from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.nodes.base.communication.result_topics import RESULT_TOPICS
from nanorocks_ros.nodes.base.communication.topic_monitor import ONE_SOURCE
from nanorocks_ros.nodes.base.epoch import Epoch
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.base.parameters import ALL_RESET, CYCLE_GOES_ON
from nanorocks_ros.nodes.base.problems import Level, Problem
from nanorocks_ros.nodes.base.told_settings import default_settings
from nanorocks_ros.nodes.sources.bag_source import (
    open_bag_frames,
    recorded_moments,
    refuse_unused_parameters,
    settings_of_bag,
)
from nanorocks_ros.nodes.sources.camera_subscription import CameraSubscription
from nanorocks_ros.nodes.sources.play_range import PlayRange
from nanorocks_ros.nodes.sources.player import Player
from nanorocks_ros.nodes.sources.simulated_tray import SimulatedTray, publish_frame
from nanorocks_ros.nodes.trays.track_images import TrackImages
from nanorocks_ros.nodes.workers.background_worker import BackgroundWorker
from nanorocks_ros.nodes.workers.graph_recorder import GraphRecorder, provenance
from nanorocks_ros.nodes.workers.live_page_process import LivePageProcess
from nanorocks_ros.pipeline.changed_settings import Part, changed_parts
from nanorocks_ros.pipeline.composition import Pipeline, Wanted
from nanorocks_ros.pipeline.parallel_pipeline import SharedPipeline, started, worker_count
from nanorocks_ros.pipeline.warm_up import (
    warm_up,
    warm_up_clusters,
    warm_up_cooling,
    warm_up_speed,
)
from nanorocks_ros.records import Tracks, TrayImage
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.nodes.sources.simulated_tray import TrayMoment
    from nanorocks_ros.pipeline.composition import Result
    from nanorocks_ros.recordings.bag.reader import BagMessage
    from nanorocks_ros.records import Frame, Notice
    from nanorocks_ros.studies.analysis.bag_frames import BagFrames

# With more frames waiting than these, images are published of one frame in ten only.
_MAX_WAITING, _SHOWN_EVERY = 3, 10
# From so many waiting frames on, of the 30 that may wait, the node warns.
_MANY_WAITING = 10


class _Job(NamedTuple):
    """The tray images of a frame, and which images to make and to publish."""

    records: Sequence[TrayImage | Notice]
    wanted: Mapping[int, Wanted]
    visible: bool


class _Done(NamedTuple):
    """The results of a frame, and whether its images are to be published."""

    results: Sequence[Result]
    visible: bool


class PipelineNode(NanorocksNode):
    """Runs all stages; records pass between them in memory.

    What follows from the tray images of a frame is computed in the background, while the next
    frame is decoded and cut: by other processes where there are cores for them, or in a thread.
    """

    def __init__(self) -> None:
        super().__init__('pipeline')
        declare = self.parameters.declare
        self._source = declare(st.SourceSettings()).source
        self._bag_settings = declare(st.BagSettings())
        self._defaults = default_settings(self)
        if self._source == 'bag':
            # What is told to the node replaces what the bag says.
            self._defaults = settings_of_bag(self, self._bag_settings)
        self._settings = declare(self._defaults, read_only=False)
        self._simulation = declare(st.SimulationSettings(), prefix='simulation.')
        self._pacing = declare(st.PacingSettings())
        camera = declare(st.CameraSettings())
        self._record_settings = declare(st.RecordSettings())
        page = declare(st.DashboardSettings(), prefix='dashboard_')
        with_page = declare(st.LivePageSettings()).dashboard
        workers = declare(st.WorkSettings()).workers
        self.parameters.refuse_unknown()
        refuse_unused_parameters(self._source, self._bag_settings, self._pacing)
        self._refuse_other_tray()
        self._as_fast_as_possible = self._source != 'topic' and self._pacing.rate == 0.0
        self._page = LivePageProcess(self, page, self._settings.trays_file) if with_page else None
        self._start_stages(workers)
        self._bag: BagFrames | None = None
        self._start_source(camera)

    def _refuse_other_tray(self) -> None:
        """Refuse to simulate a tray that is not measured, before anything is compiled."""
        if self._source == 'simulator' and self._simulation.tray not in self._settings.trays:
            raise ConfigurationError(
                'parameter simulation.tray',
                f'{self._simulation.tray} is not among trays {self._settings.trays}',
                'set both',
            )

    def _start_stages(self, workers: int) -> None:
        """Offer all topics, start the workers, and build the stages."""
        self._epoch = Epoch(self, may_set=True, follow=self._source == 'topic')
        self._recorder: GraphRecorder | None = None
        self._frame_count = 0
        # What to call the camera in an error.
        self._camera_name = self._source
        self._view: View | None = None
        self._workers = started(worker_count(workers, len(self._settings.trays)))
        self._offer_topics()
        self._background = BackgroundWorker(self, self._follow, self._publish)
        self.diagnostics.watched.append(self._waiting_frames)
        # Meanwhile others discover the publishers.
        warm_up()
        if not self._workers:
            warm_up_speed()
            warm_up_clusters()
            warm_up_cooling()
        for number, worker in enumerate(self._workers):
            self.tell_progress(f'starting: {number} of {len(self._workers)} processes are ready')
            worker.ready()
        self._adopt(self._settings, self._build(self._settings))
        self.parameters.react_to_changes(self._settings, self._build, self._change)

    def _offer_topics(self) -> None:
        self.outputs.offer((topics.EPOCH,))
        # With source 'topic' another node publishes the camera.
        if self._source != 'topic':
            self.outputs.offer((topics.RAW,))
            self.topic_monitor.require_single_publisher(topics.RAW.name)
        for tray in self._settings.trays:
            self.outputs.offer(RESULT_TOPICS, tray)
            if self._source == 'simulator':
                self.outputs.offer((topics.TRUTH,), tray)
            self.topic_monitor.require_single_publisher(topics.SPEED.of(tray), ONE_SOURCE)

    # Stages

    def _build(self, settings: st.PipelineSettings) -> Pipeline:
        if self._workers:
            return SharedPipeline(settings, self._camera_name, self._view, self._workers)
        return Pipeline(settings, self._camera_name, self._view, contacts_suffice=True)

    def _change(
        self, before: st.PipelineSettings, after: st.PipelineSettings, pipeline: Pipeline
    ) -> str:
        self._background.drain()
        parts = changed_parts(before, after)
        if parts & (Part.IMAGES | Part.MEASUREMENT):
            self._adopt(after, pipeline)
            return ALL_RESET
        self._settings = after
        self._pipeline.adopt(after, parts)
        self.diagnostics.note_priors(after.prior)
        return CYCLE_GOES_ON

    def _adopt(self, settings: st.PipelineSettings, pipeline: Pipeline) -> None:
        self._settings, self._pipeline = settings, pipeline
        self.diagnostics.note_priors(settings.prior)
        pipeline.prepare()
        self._track_images = TrackImages(self, calibrated(settings).preprocess.pixels_per_metre)

    def _rebuild(self, camera_name: str, view: View | None = None) -> None:
        self._camera_name, self._view = camera_name, view
        self._pipeline = self._build(self._settings)
        self._pipeline.prepare()

    def _waiting_frames(self) -> Problem | None:
        waiting = self._background.waiting
        # A source that waits for the trays, as fast as possible, keeps all places taken.
        if self._as_fast_as_possible or waiting <= _MANY_WAITING:
            return None
        return Problem(
            Level.WARN,
            f'{waiting} frames wait for the trays: this machine is too slow; follow fewer trays, '
            'or set workers:= to the number of its cores',
        )

    # Sources

    def _start_source(self, camera: st.CameraSettings) -> None:
        if self._source == 'topic':
            self._subscribe(camera)
        elif self._source == 'simulator':
            self._play_simulated()
        else:
            self._play_recorded()

    def _subscribe(self, settings: st.CameraSettings) -> None:
        def on_frame(frame: Frame) -> None:
            self._record(frame, camera.message)
            self._epoch.when_known(frame.stamp_ns, self._push, frame)

        def on_view() -> None:
            self._background.drain()
            if self._recorder is not None:
                self._recorder.record_camera_info(camera.camera_info)
            self._rebuild(self._camera_name, camera.view)

        calibrated_by_file = bool(self._settings.preprocess.calibration)
        camera = CameraSubscription(
            self, settings, on_frame, None if calibrated_by_file else on_view
        )
        self._rebuild(camera.topic)

    def _play_simulated(self) -> None:
        source = SimulatedTray(self, self._simulation, self._settings.trays_file)

        def emit(_: int, moment: TrayMoment) -> None:
            frame, truth = source.stamped(moment)
            self._emit_frame(frame)
            self.outputs.publish_result(truth, self._epoch.ns)
            self.diagnostics.process(self._push, frame)

        self._player = Player(self, source.moments(), emit, self._pacing, self._finish)

    def _play_recorded(self) -> None:
        bag = open_bag_frames(self._bag_settings)
        play_range = PlayRange(self, bag.reader, self._bag_settings, self._pacing.duration)
        play_range.require([bag.topic], 'frame')
        self._rebuild(bag.where, bag.view())
        self._bag = bag
        epoch_ns = bag.epoch_ns()
        if epoch_ns is not None:
            self._epoch.set(epoch_ns)

        def emit(_: int, moment: tuple[Frame | FrameError, BagMessage]) -> None:
            frame, message = moment
            if isinstance(frame, FrameError):
                self.diagnostics.refuse(frame)
                return
            self._emit_frame(frame, message)
            self.diagnostics.process(self._push, frame)

        # The range has the duration already.
        pacing = replace(self._pacing, duration=0.0)
        self._player = Player(self, recorded_moments(bag, play_range), emit, pacing, self._finish)

    def _emit_frame(self, frame: Frame, message: BagMessage | None = None) -> None:
        """Set the epoch with the first frame; record and publish the frame."""
        if not self._epoch.is_known:
            self._epoch.set(frame.stamp_ns)
        self._record(frame, message)
        publish_frame(self, frame)

    def start_recording(self) -> None:
        """Record from now on; last, so that no bag is left behind when the rest cannot start."""
        if not self._record_settings.record:
            return
        of_source: dict[str, tuple[Any, ...]] = {
            'simulator': (self._simulation,),
            'bag': (self._bag_settings,),
            'topic': (),
        }
        self._recorder = GraphRecorder(
            self,
            self._record_settings,
            provenance(self._source, self._settings, *of_source[self._source]),
            self._settings.trays,
            wait_for_disk=self._as_fast_as_possible,
        )
        self.outputs.recorder = self._recorder
        if self._bag is not None and (camera_info := self._bag.lens_message()) is not None:
            self._recorder.record_camera_info(camera_info)

    def end_recording(self) -> None:
        """Write what waits, and the index."""
        if self._recorder is not None:
            self._recorder.close()

    def _record(self, frame: Frame, message: object) -> None:
        if self._recorder is not None:
            self._recorder.record_frame(frame, message)

    # Frames

    def _push(self, frame: Frame) -> None:
        if self._recorder is not None:
            self._recorder.record_epoch(self._epoch.ns)
        waiting = self._background.waiting
        # Somebody who views images must not keep the graph from measuring.
        self._frame_count += 1
        visible = (
            self._as_fast_as_possible
            or waiting <= _MAX_WAITING
            or self._frame_count % _SHOWN_EVERY == 0
        )
        wanted = {
            tray: Wanted(
                self.outputs.has_subscribers(topics.MOTION, tray) and visible,
                self._track_images.has_subscribers(tray),
                self.outputs.has_subscribers(topics.AUTOCORRELATION, tray) and visible,
            )
            for tray in self._pipeline.trays
        }
        self._background.put(_Job(self._pipeline.preprocessor.push(frame), wanted, visible))
        self.diagnostics.values['frames waiting for the trays'] = waiting

    def _follow(self, job: _Job) -> _Done:
        """Compute the results of a frame, in the background."""
        return _Done(self._pipeline.follow(job.records, job.wanted), job.visible)

    def _publish(self, done: _Done) -> None:
        self.outputs.publishes_images = done.visible
        image = None
        for record in done.results:
            if isinstance(record, TrayImage):
                image = record
            if isinstance(record, Tracks):
                # The tracks come right after the image that they end in.
                if image is not None:
                    self._track_images.publish(image, record, visible=done.visible)
            else:
                self.outputs.publish_result(record, self._epoch.ns)

    def _finish(self) -> None:
        self._background.drain()
        # Images that were held back may be among the last results.
        self._publish(_Done(self._pipeline.flush(), True))
        self.end_recording()
        self.finish()

    def interrupt(self) -> None:
        """Do not wait until there is room for another frame."""
        self._background.interrupted = True

    def end_helpers(self) -> None:
        """Leave out the frames that wait for the trays; processes end while the bag is written."""
        self._background.close()
        for worker in self._workers:
            worker.kill()
        if self._page is not None:
            self._page.interrupt()

    def destroy_node(self) -> None:
        """Wait for the processes, before the node that they work for."""
        for worker in self._workers:
            worker.close()
        if self._page is not None:
            self._page.close()
        super().destroy_node()
