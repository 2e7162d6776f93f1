"""Picture of drawn cameras over some trays: ``python -m benchmarks.drawn_cameras OUT.png``."""

from __future__ import annotations

import sys

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.plate_scene.drawn_camera import drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm

# Tray and seed of the camera; two of each row share its width.
_DRAWN = ((1, 2), (1, 11), (3, 12), (3, 16), (7, 18), (5, 17))
_WIDTH = 280
_SECONDS = 0.5
_PAPER = 255
_WHITE = (_PAPER, _PAPER, _PAPER)


def picture(tray: int, seed: int) -> np.ndarray:
    """A frame of a tray half a second after a shaking event, enlarged to a common width."""
    cell = load_trays()[tray]
    gas = SimulationSettings(seed=seed, first_shake=0.0, mean_speed=0.01)
    camera = drawn_camera(seed, cell, gas)
    film = SceneFilm(camera.simulation, camera.scene, {tray: cell})
    image = film.at(round(_SECONDS * camera.simulation.frame_rate), 0).frame.image
    height = round(_WIDTH * image.shape[0] / image.shape[1])
    nearer = image.shape[1] < _WIDTH
    how = cv2.INTER_NEAREST if nearer else cv2.INTER_AREA
    return cv2.resize(image, (_WIDTH, height), interpolation=how)


def main(path: str) -> None:
    """Write the picture."""
    pictures = [picture(tray, seed) for tray, seed in _DRAWN]
    columns = []
    for side in (0, 1):
        column = pictures[side::2]
        gaps = [np.full((8, _WIDTH, 3), _PAPER, dtype=np.uint8) for _ in column]
        columns.append(
            np.vstack([part for pair in zip(column, gaps, strict=True) for part in pair])
        )
    height = max(len(column) for column in columns)
    padded = [
        cv2.copyMakeBorder(
            column, 0, height - len(column), 0, gap, cv2.BORDER_CONSTANT, value=_WHITE
        )
        for column, gap in zip(columns, (8, 0), strict=True)
    ]
    whole = np.hstack(padded)
    cv2.imwrite(path, whole, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == '__main__':
    main(sys.argv[1])
