"""Films of the plate for several benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.records import BeadsTruth, Frame, TrayImage
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from nanorocks_ros.records import Notice

SCALE = 12500.0
RATE = 30.0
TRAYS = (1, 2, 3, 4, 5, 6, 7)
# Mean speed in the image plane over that in space, of an isotropic gas.
_PROJECTED = np.pi / 4.0


@dataclass(frozen=True)
class Shot:
    """One frame: its JPEG, the images of the trays, the truth."""

    jpeg: NDArray[np.uint8]
    images: dict[int, TrayImage]
    truth: dict[int, BeadsTruth]


def filmed(
    speed: float, *, effects: bool, frames: int, trays: tuple[int, ...] = TRAYS, **values: float
) -> tuple[list[Shot], SceneFilm]:
    """The whole plate, with all effects (JPEG 85) or without any, and the tray images of it.

    Parameters
    ----------
    speed : float, [m/s]
        Mean speed in the image plane after shaking.
    effects : bool
    frames : int
    trays : tuple of int
        Filmed and preprocessed.
    **values
        Further settings of the simulation.
    """
    scene = with_values(SceneSettings(trays=trays), {'swing_knocks': False}, 'benchmark')
    scene = scene if effects else without_effects(scene)
    simulation = SimulationSettings(
        mean_speed=speed / _PROJECTED, first_shake=0.3, frame_rate=RATE, **values
    )
    film = SceneFilm(simulation, scene)
    names = {
        'trays': list(trays),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
    }
    settings = with_values(PipelineSettings(), names, 'benchmark')
    flown = load_trays()
    view = View(camera=film.camera.geometry.camera)
    stage = Preprocessor(settings, {n: flown[n] for n in trays}, 'film', view)
    shots = []
    by_stamp: dict[int, dict[int, TrayImage]] = {}
    for moment in film.moments(frames):
        jpeg = cv2.imencode('.jpg', moment.frame.image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
        image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR) if effects else moment.frame.image
        frame = Frame(stamp_ns=moment.frame.stamp_ns, encoding='bgr8', image=image)
        images = by_stamp[frame.stamp_ns] = {}
        shots.append(Shot(jpeg, images, {bead.tray: bead for bead in moment.beads}))
        _sort_images(by_stamp, stage.push(frame))
    _sort_images(by_stamp, stage.flush())
    return shots, film


def _sort_images(
    by_stamp: dict[int, dict[int, TrayImage]], records: Iterable[TrayImage | Notice]
) -> None:
    """Give each image, which may come some frames late, to its shot."""
    for record in records:
        if isinstance(record, TrayImage):
            by_stamp[record.stamp_ns][record.tray] = record
