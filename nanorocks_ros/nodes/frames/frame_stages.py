"""All stages behind the frames: computed in the background, published by the node.

Tested by ``test/nodes/test_pipeline.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.nodes.base.parameters import ALL_RESET, CYCLE_GOES_ON
from nanorocks_ros.nodes.base.problems import Level, Problem
from nanorocks_ros.nodes.trays.track_images import TrackImages
from nanorocks_ros.nodes.workers.background_worker import BackgroundWorker
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
    from nanorocks_ros.nodes.base.epoch import Epoch
    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.pipeline.composition import Result
    from nanorocks_ros.records import Frame, Notice
    from nanorocks_ros.settings import PipelineSettings

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


class FrameStages:
    """Cuts frames, computes all that follows from them, and publishes it.

    What follows from the tray images of a frame is computed in the background, while the next
    frame is decoded and cut: by other processes where there are cores for them, or in a thread.

    Parameters
    ----------
    node : NanorocksNode
    epoch : Epoch
    camera_name : str
        What to call the camera in an error.
    workers : int
        As in `WorkSettings`, for `tray_count` trays.
    tray_count : int
    as_fast_as_possible : bool
        Whether the source waits for the stages.
    """

    def __init__(
        self,
        node: NanorocksNode,
        epoch: Epoch,
        camera_name: str,
        *,
        workers: int,
        tray_count: int,
        as_fast_as_possible: bool,
    ) -> None:
        self._node, self._epoch = node, epoch
        self._camera_name = camera_name
        self._view: View | None = None
        self._as_fast_as_possible = as_fast_as_possible
        self._frame_count = 0
        self._workers = started(worker_count(workers, tray_count))
        self._background = BackgroundWorker(node, self._follow, self._publish)
        node.diagnostics.watched.append(self._waiting_frames)

    def warm_up(self) -> None:
        """Compile all functions here, or wait until the worker processes have."""
        warm_up()
        if not self._workers:
            warm_up_speed()
            warm_up_clusters()
            warm_up_cooling()
        for number, worker in enumerate(self._workers):
            self._node.tell_progress(
                f'starting: {number} of {len(self._workers)} processes are ready'
            )
            worker.ready()

    # Settings

    def build(self, settings: PipelineSettings) -> Pipeline:
        """The stages for some settings, not used yet."""
        if self._workers:
            return SharedPipeline(settings, self._camera_name, self._view, self._workers)
        return Pipeline(settings, self._camera_name, self._view, contacts_suffice=True)

    def adopt(self, settings: PipelineSettings, pipeline: Pipeline) -> None:
        """Use stages from the next frame on."""
        self.settings, self._pipeline = settings, pipeline
        self._node.diagnostics.note_priors(settings.prior)
        pipeline.prepare()
        scale = calibrated(settings).preprocess.pixels_per_metre
        self._track_images = TrackImages(self._node, scale)

    def change(self, before: PipelineSettings, after: PipelineSettings, pipeline: Pipeline) -> str:
        """Take other settings, with new stages where the old ones cannot go on."""
        self.drain()
        parts = changed_parts(before, after)
        if parts & (Part.IMAGES | Part.MEASUREMENT):
            self.adopt(after, pipeline)
            return ALL_RESET
        self.settings = after
        self._pipeline.adopt(after, parts)
        self._node.diagnostics.note_priors(after.prior)
        return CYCLE_GOES_ON

    def look_through(self, camera_name: str, view: View | None = None) -> None:
        """Begin anew with the frames of a camera."""
        self._camera_name, self._view = camera_name, view
        self._pipeline = self.build(self.settings)
        self._pipeline.prepare()

    # Frames

    def push(self, frame: Frame) -> None:
        """Cut the next frame, and have it followed."""
        waiting = self._background.waiting
        # Somebody who views images must not keep the graph from measuring.
        self._frame_count += 1
        visible = (
            self._as_fast_as_possible
            or waiting <= _MAX_WAITING
            or self._frame_count % _SHOWN_EVERY == 0
        )
        outputs = self._node.outputs
        wanted = {
            tray: Wanted(
                outputs.has_subscribers(topics.MOTION, tray) and visible,
                self._track_images.has_subscribers(tray),
                outputs.has_subscribers(topics.AUTOCORRELATION, tray) and visible,
            )
            for tray in self._pipeline.trays
        }
        self._background.put(_Job(self._pipeline.preprocessor.push(frame), wanted, visible))
        self._node.diagnostics.values['frames waiting for the trays'] = waiting

    def drain(self) -> None:
        """Wait until all frames so far are followed, and publish the results."""
        self._background.drain()

    def flush(self) -> None:
        """Publish all results, also those that were held back for further frames."""
        self.drain()
        # Images that were held back may be among the last results.
        self._publish(_Done(self._pipeline.flush(), True))

    def interrupt(self) -> None:
        """Do not wait until there is room for another frame."""
        self._background.interrupted = True

    def end(self) -> None:
        """Leave out the frames that wait, and ask the worker processes to end."""
        self._background.close()
        for worker in self._workers:
            worker.kill()

    def close(self) -> None:
        """Wait for the worker processes."""
        for worker in self._workers:
            worker.close()

    def _follow(self, job: _Job) -> _Done:
        """Compute the results of a frame, in the background."""
        return _Done(self._pipeline.follow(job.records, job.wanted), job.visible)

    def _publish(self, done: _Done) -> None:
        outputs = self._node.outputs
        outputs.publishes_images = done.visible
        image = None
        for record in done.results:
            if isinstance(record, TrayImage):
                image = record
            if isinstance(record, Tracks):
                # The tracks come right after the image that they end in.
                if image is not None:
                    self._track_images.publish(image, record, visible=done.visible)
            else:
                outputs.publish_result(record, self._epoch.ns)

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
