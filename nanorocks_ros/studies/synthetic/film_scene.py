"""Film of the whole plate: as a bag with the truth, a video, or one image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros import __version__
from nanorocks_ros.experiment.recorded_experiment import experiment_metadata
from nanorocks_ros.outputs.photographs import write_photograph
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    camera_info_message,
    compressed_image_message,
    dimensioned_array_message,
    float_array_message,
    time_message,
)
from nanorocks_ros.records import GroundTruth
from nanorocks_ros.settings import rows
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.studies.synthetic.film_bag import START_NS, check_quality
from nanorocks_ros.studies.synthetic.film_compression import check_codec, compressed
from nanorocks_ros.studies.synthetic.film_video import images_into_video
from nanorocks_ros.studies.synthetic.simulated_plan import check_duration
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout, to_array
from nanorocks_ros.wire.bead_truth import beads_layout, beads_to_array

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from nanorocks_ros.experiment.lens import Camera
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.settings import (
        CompressionSettings,
        SceneSettings,
        SimulationSettings,
    )
    from nanorocks_ros.simulation.plate_scene.plate_film import SceneMoment
    from nanorocks_ros.studies.synthetic.film_video import VideoQuality

CAMERA_MODEL = 'equidistant'


class SceneRecorder:
    """Films the plate; all films of a recorder are the same.

    Parameters
    ----------
    simulation : SimulationSettings
    scene : SceneSettings
    duration : float, [s], > 0
    trays : mapping of int to Tray, optional
        All cells of the plate; by default those of the flight.
    trays_file : str
        File that describes them, kept in a bag; empty: those of the flight.

    Raises
    ------
    ConfigurationError
        For a duration out of range.
    """

    def __init__(
        self,
        simulation: SimulationSettings,
        scene: SceneSettings,
        duration: float,
        trays: Mapping[int, Tray] | None = None,
        trays_file: str = '',
    ) -> None:
        check_duration(duration)
        self._trays_file = trays_file
        self._simulation, self._scene, self._trays = simulation, scene, trays
        self.duration = duration
        self.frames = max(1, round(duration * simulation.frame_rate))

    @property
    def summary(self) -> dict[str, Any]:
        """Number of frames, duration, trays, seed."""
        return {
            'frames': self.frames,
            'duration': self.duration,
            'trays': sorted(self._scene.trays),
            'seed': self._simulation.seed,
        }

    def into_picture(self, path: Path) -> None:
        """Write the last frame without compression losses.

        Raises
        ------
        ConfigurationError, SimulationError
            When the scene cannot be filmed.
        RecordingError
            When the picture cannot be written.
        """
        moment = self._film().at(self.frames - 1, START_NS)
        write_photograph(path, moment.frame.image)

    def into_video(
        self, path: Path, progress: Progress, quality: VideoQuality | None = None
    ) -> None:
        """Write a video.

        Raises
        ------
        ConfigurationError, SimulationError
            When the scene cannot be filmed.
        RecordingError
            When the video cannot be written.
        """
        moments = self._film().moments(self.frames)
        images = (moment.frame.image for moment in moments)
        images_into_video(
            path,
            self._simulation,
            images,
            frames=self.frames,
            progress=progress,
            quality=quality,
        )

    def into_bag(
        self, path: Path, compression: CompressionSettings, quality: int, progress: Progress
    ) -> None:
        """Write a bag: compressed camera images, lens, epoch, and the truth of every tray.

        Raises
        ------
        ConfigurationError, SimulationError
            When the scene cannot be filmed.
        RecordingError
            When the bag cannot be written.
        """
        check_quality(quality)
        check_codec(compression)
        # Before the bag, so that a scene that cannot be filmed leaves no files.
        film = self._film()
        moments = film.moments(self.frames, START_NS)
        compressed_moments = compressed(
            moments, compression, quality=quality, frame_rate=self._simulation.frame_rate
        )
        with BagWriter(path, self._table(), metadata=self._provenance(film, compression)) as bag:
            bag.write(topics.EPOCH.absolute(), START_NS, time_message(START_NS))
            info = lens_message(film.camera.geometry.camera, START_NS)
            bag.write(topics.CAMERA_INFO.absolute(), START_NS, info)
            for done, (moment, jpeg) in enumerate(compressed_moments, start=1):
                _write(bag, moment, jpeg)
                progress(done, self.frames)

    def _film(self) -> SceneFilm:
        return SceneFilm(self._simulation, self._scene, self._trays)

    def _table(self) -> dict[str, Any]:
        common = (topics.EPOCH, topics.CAMERA_INFO, topics.RAW_COMPRESSED)
        table = {topic.absolute(): offered_topic(topic) for topic in common}
        for tray in self._scene.trays:
            for topic in (topics.TRUTH, topics.BEADS):
                table[topic.absolute(tray)] = offered_topic(topic)
        return table

    def _provenance(self, film: SceneFilm, compression: CompressionSettings) -> dict[str, str]:
        simulated = {row.name: str(row.default) for row in rows(self._simulation)}
        # These settings of a single tray do not apply: the scene has its own.
        for name in ('tray', 'noise', 'pixels_per_metre'):
            simulated.pop(name)
        return {
            'nanorocks_ros': __version__,
            **simulated,
            **{row.name: str(row.default) for row in rows(self._scene, 'scene.')},
            **{row.name: str(row.default) for row in rows(compression, 'compression.')},
            **experiment_metadata(
                {
                    'trays': sorted(self._scene.trays),
                    'trays_file': self._trays_file,
                    'preprocess.pixels_per_metre': self._scene.pixels_per_metre,
                    **self._places(film),
                }
            ),
        }

    def _places(self, film: SceneFilm) -> dict[str, Any]:
        """Settings that say where the trays are in the picture."""
        if not self._scene.close_up:
            return {'preprocess.layout': 'plate'}
        regions = (film.camera.geometry.regions[number] for number in sorted(self._scene.trays))
        return {'preprocess.regions_px': [side for region in regions for side in region]}


def lens_message(camera: Camera, stamp_ns: int) -> object:
    """The lens as a sensor_msgs/CameraInfo message."""
    return camera_info_message(
        stamp_ns,
        'camera',
        (camera.width, camera.height),
        camera.matrix,
        (CAMERA_MODEL, camera.distortion),
    )


def _write(bag: BagWriter, moment: SceneMoment, jpeg: bytes) -> None:
    stamp_ns = moment.frame.stamp_ns
    picture = compressed_image_message(stamp_ns, 'camera', 'bgr8; jpeg compressed bgr8', jpeg)
    bag.write(topics.RAW_COMPRESSED.absolute(), stamp_ns, picture)
    labels = layout(GroundTruth).labels
    for truth in moment.trays:
        values = to_array(truth, START_NS)
        name = topics.TRUTH.absolute(truth.tray)
        bag.write(name, stamp_ns, float_array_message(labels, values))
    for beads in moment.beads:
        dimensions = beads_layout().dimensions(len(beads.radii))
        message = dimensioned_array_message(dimensions, beads_to_array(beads, START_NS))
        bag.write(topics.BEADS.absolute(beads.tray), stamp_ns, message)
