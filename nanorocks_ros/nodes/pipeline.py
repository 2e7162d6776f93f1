"""Node: the whole data path in one process, from a simulator, a bag or a camera topic."""

from __future__ import annotations

from dataclasses import replace

from nanorocks_ros import settings as st
from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.nodes import _sources
from nanorocks_ros.nodes._background import Background
from nanorocks_ros.nodes._camera import Camera
from nanorocks_ros.nodes._epoch import Epoch
from nanorocks_ros.nodes._live_page import LivePage
from nanorocks_ros.nodes._node import RESULT_TOPICS, NanorocksNode
from nanorocks_ros.nodes._pacing import Pacer
from nanorocks_ros.nodes._part import Part
from nanorocks_ros.nodes._recorder import GraphRecorder, provenance
from nanorocks_ros.nodes._tracks import TracksPicture
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

# With more frames behind than these, pictures are published of one frame in so many.
_BEHIND, _SHOWN_BEHIND = 3, 10


class PipelineNode(NanorocksNode):
    """Composes the stages; records pass between them in memory.

    What follows from the tray images of a frame is worked out in the background, while the next
    frame is decoded and cut: by other processes where there are cores for them, or in a thread.
    """

    def __init__(self):
        super().__init__('pipeline')
        self._settings = self.declare(st.PipelineSettings(), fixed=False)
        self._source = self.declare(st.SourceSettings()).source
        self._simulation = self.declare(st.SimulationSettings(), prefix='simulation.')
        self._bag = self.declare(st.BagSettings())
        self._pacing = self.declare(st.PacingSettings())
        camera = self.declare(st.CameraSettings())
        record = self.declare(st.RecordSettings())
        page = self.declare(st.DashboardSettings(), prefix='dashboard_')
        shown = self.declare(st.LivePageSettings()).dashboard
        workers = self.declare(st.WorkSettings()).workers
        self.refuse_unknown_parameters()
        _sources.refuse_unused(self._source, self._bag, self._pacing)
        self._page = LivePage(self, page, self._settings.trays_file) if shown else None
        self._epoch = Epoch(self, may_set=True, follow=self._source == 'topic')
        self._recorded = None
        self._frames = 0
        self._where = self._source
        self._camera, self._view = None, None
        self._workers = started(worker_count(workers, len(self._settings.trays)))
        self._offer_everything()
        self._background = Background(self, self._follow, self._publish)
        # Others find the publishers meanwhile.
        warm_up()
        if not self._workers:
            warm_up_speed()
            warm_up_clusters()
            warm_up_cooling()
        for worker in self._workers:
            worker.ready()
        self._adopt(self._settings, self._build(self._settings))
        self.react_to_parameters(st.PipelineSettings(), self._build, self._adopt)
        if self._source == 'topic':
            look = None if self._settings.preprocess.calibration else self._straighten
            self._camera = Camera(self, camera, self._take, look)
            self._name_source(self._camera.topic)
        elif self._source == 'simulator':
            self._play_simulated()
        else:
            self._play_recorded()
        # Last, so that nothing is left behind where the rest cannot start.
        if record.record:
            self._start_recording(record)

    def _start_recording(self, record):
        of_source = {'simulator': (self._simulation,), 'bag': (self._bag,), 'topic': ()}
        kept = provenance(self._source, self._settings, *of_source[self._source])
        # Who plays as fast as it goes waits for the disk as well.
        self.recorder = GraphRecorder(self, record, kept, self._settings.trays, self._patient)
        lens = self._recorded.lens_message() if self._recorded is not None else None
        if lens is not None:
            self.recorder.lens(lens)

    @property
    def _patient(self):
        """Whether the frames come as fast as they are taken."""
        return self._source != 'topic' and self._pacing.rate == 0.0

    def _offer_everything(self):
        self.offer((topics.EPOCH,))
        # A camera that others publish has one publisher, theirs.
        if self._source != 'topic':
            self.offer((topics.RAW,))
            self.watch.alone_on(topics.RAW.name)
        for tray in self._settings.trays:
            self.offer(RESULT_TOPICS, tray)

    def _build(self, settings):
        if self._workers:
            return SharedPipeline(settings, self._where, self._view, self._workers)
        return Pipeline(settings, self._where, self._view)

    def _adopt(self, settings, pipeline):
        self._background.drain()
        self._settings, self._pipeline = settings, pipeline
        pipeline.prepare()
        self._picture = TracksPicture(self, calibrated(settings).preprocess.pixels_per_metre)

    def _straighten(self):
        self._background.drain()
        self._view = self._camera.view
        if self.recorder is not None:
            self.recorder.lens(self._camera.lens_message)
        self._rebuild()

    def _name_source(self, where, view=None):
        self._where, self._view = where, view
        self._rebuild()

    def _rebuild(self):
        self._pipeline = self._build(self._settings)
        self._pipeline.prepare()

    def _play_simulated(self):
        if self._simulation.tray not in self._settings.trays:
            raise ConfigurationError(
                'parameter simulation.tray',
                f'{self._simulation.tray} is not among trays {self._settings.trays}',
                'set both',
            )
        source = _sources.Simulated(self, self._simulation, self._settings.trays_file)
        self._play(source.moments(), source.dated)

    def _play_recorded(self):
        bag = _sources.opened_bag(self._bag)
        part = Part(self, bag.reader, self._bag, self._pacing.duration)
        part.require([bag.topic], 'frame')
        self._name_source(bag.where, bag.view())
        self._recorded = bag
        self._epoch.set(bag.epoch_ns())
        self._pacing = replace(self._pacing, duration=0.0)
        self._play(_sources.recorded_moments(bag, part), tuple)

    def _play(self, moments, dated):
        def emit(_, moment):
            frame, truth, *received = dated(moment)
            if isinstance(frame, FrameError):
                self.refuse(frame)
                return
            if self._epoch.ns is None:
                self._epoch.set(frame.stamp_ns)
            self._record(frame, *received)
            _sources.publish_moment(self, (frame, truth), self._epoch.ns)
            self.timed(self._push, frame)

        self._pacer = Pacer(self, moments, emit, self._pacing, self._finish)

    def _record(self, frame, message=None):
        if self.recorder is not None:
            self.recorder.frame(frame, message)

    def _take(self, frame):
        self._record(frame, self._camera.message)
        self._epoch.when_known(frame.stamp_ns, self._push, frame)

    def _push(self, frame):
        if self.recorder is not None:
            self.recorder.epoch(self._epoch.ns)
        waiting = self._background.waiting
        # Who only looks must not keep the graph from measuring.
        self._frames += 1
        shown = self._patient or waiting <= _BEHIND or self._frames % _SHOWN_BEHIND == 0
        wanted = {
            number: Wanted(
                self.wanted(topics.MOTION, number) and shown,
                self._picture.wanted(number),
                self.wanted(topics.AUTOCORRELATION, number) and shown,
            )
            for number in self._pipeline.trays
        }
        self._background.put((self._pipeline.preprocessor.push(frame), wanted, shown))
        self.state['frames waiting for the trays'] = waiting

    def _follow(self, job):
        records, wanted, shown = job
        return self._pipeline.follow(records, wanted), shown

    def _publish(self, found):
        records, self.pictures = found
        image = None
        for record in records:
            if isinstance(record, TrayImage):
                image = record
            if isinstance(record, Tracks):
                # What follows from an image comes right after it.
                self._picture.send(image, record, self.pictures)
            else:
                self.publish_result(record, self._epoch.ns)

    def _finish(self):
        self._background.drain()
        for record in self._pipeline.flush():
            self.publish_result(record, self._epoch.ns)
        if self.recorder is not None:
            self.recorder.close()
        self.finish()

    def destroy_node(self):
        """End the threads and processes before what they work for is gone."""
        # First the processes: the thread need not wait for what they are doing.
        for worker in self._workers:
            worker.close()
        self._background.close()
        if self.recorder is not None:
            self.recorder.close()
        if self._page is not None:
            self._page.close()
        super().destroy_node()
