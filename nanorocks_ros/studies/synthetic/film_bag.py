"""Film of a simulated tray as a bag: compressed camera images, epoch, truth.

Tested by ``test/studies/synthetic/test_simulated_runs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.recorded_experiment import experiment_metadata
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.jobs.progress import Progress
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.image_messages import encode_jpeg
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    float_array_message,
    time_message,
)
from nanorocks_ros.records import GroundTruth
from nanorocks_ros.settings import SimulationSettings, rows
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.studies.synthetic.simulated_plan import check_duration
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout, to_array

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray

# Fixed, so that bags of the same seed are equal, byte by byte.
START_NS = 1_000_000_000_000_000_000


def film_into_bag(
    path: Path,
    settings: SimulationSettings,
    *,
    duration: float,
    quality: int,
    progress: Progress,
    tray: Tray | None = None,
    trays_file: str = '',
) -> dict[str, Any]:
    """Film a simulated tray into a new bag.

    Parameters
    ----------
    path : Path
        Must not exist.
    settings : SimulationSettings
    duration : float, [s], > 0
    quality : int
        Of the JPEGs, 1 to 100.
    progress : callable
        Called with the number of written frames and the number of frames.
    tray : Tray, optional
        By default the flown tray with the number in the settings.
    trays_file : str
        File that describes the tray, kept in the bag; empty: it was flown.

    Returns
    -------
    dict
        Number of frames, duration, tray, seed.

    Raises
    ------
    ConfigurationError
        For a duration or quality out of range, or an unknown tray.
    RecordingError
        When the bag cannot be written.
    """
    check_duration(duration)
    check_quality(quality)
    tray = tray or tray_by_number(load_trays(), settings.tray)
    frames = max(1, round(duration * settings.frame_rate))
    truth_topic = topics.TRUTH.absolute(settings.tray)
    table = {
        topics.EPOCH.absolute(): offered_topic(topics.EPOCH),
        topics.RAW_COMPRESSED.absolute(): offered_topic(topics.RAW_COMPRESSED),
        truth_topic: offered_topic(topics.TRUTH),
    }
    labels = layout(GroundTruth).labels
    provenance = {
        'nanorocks_ros': __version__,
        **{row.name: str(row.default) for row in rows(settings)},
        **experiment_metadata(
            {
                'trays': [settings.tray],
                'trays_file': trays_file,
                'preprocess.layout': 'centred',
                'preprocess.pixels_per_metre': settings.pixels_per_metre,
            }
        ),
    }
    # Before the bag, so that a tray that does not fit leaves no files.
    moments = film(settings, tray, frames, start_stamp_ns=START_NS)
    with BagWriter(path, table, metadata=provenance) as bag:
        bag.write(topics.EPOCH.absolute(), START_NS, time_message(START_NS))
        for done, (frame, truth) in enumerate(moments, start=1):
            picture = compressed_image_message(
                frame.stamp_ns,
                'camera',
                'bgr8; jpeg compressed bgr8',
                encode_jpeg(frame.image, quality),
            )
            bag.write(topics.RAW_COMPRESSED.absolute(), frame.stamp_ns, picture)
            values = to_array(truth, START_NS)
            bag.write(truth_topic, truth.stamp_ns, float_array_message(labels, values))
            progress(done, frames)
    return {'frames': frames, 'duration': duration, 'tray': settings.tray, 'seed': settings.seed}


def check_quality(quality: int) -> None:
    """Raise for a quality that is out of range.

    Raises
    ------
    ConfigurationError
        Unless it is 1 to 100.
    """
    if not 1 <= quality <= 100:
        raise ConfigurationError('--quality', f'{quality}', 'give a number from 1 to 100')


def check_camera(settings: SimulationSettings, tray: Tray) -> None:
    """Raise for an image that the tray does not fit into.

    Raises
    ------
    SimulationError
        With the sizes of both.
    """
    TrayCamera(settings, tray, np.array([tray.diameter]), (tray.species[0].material,))
