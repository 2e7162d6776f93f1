"""Cameras near to one tray: what a frame costs, and a picture of some that are drawn.

``python -m benchmarks drawn_cameras`` prints the cost; the picture of the documentation is made
by ``python -m benchmarks.drawn_cameras OUT.png``.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SceneSettings, SimulationSettings
from nanorocks_ros.simulation.plate_scene.drawn_camera import drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects

# Tray and seed of the camera; two of each row share its width.
_DRAWN = ((1, 2), (1, 11), (3, 12), (3, 16), (7, 18), (5, 17))
_WIDTH = 280
_SECONDS = 0.5
# Changes of a scene whose cost is printed.
_CASES: dict[str, dict[str, float]] = {
    'without motion blur': {'exposure': 0.0},
    'all effects, tray and camera at rest': {},
    'and the tray swings': {'swing': 0.0002},
    'and the camera sways': {'camera_sway_px': 2.0},
}
_FRAMES = 100
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


def report() -> None:
    """Print what a frame of 400 x 300 px costs, with an exposure of half the frame interval."""
    cv2.setNumThreads(1)
    gas = SimulationSettings(width_px=400, height_px=300, first_shake=0.1, mean_speed=0.01)
    blurred = replace(
        without_effects(SceneSettings()),
        trays=(1,),
        close_up=True,
        pixels_per_metre=13500.0,
        defocus_px=0.7,
        noise=3.0,
        shadows=0.3,
        rim_width=0.001,
        bayer='rggb',
        camera_height=0.2,
        exposure=0.5,
    )
    print('| tray 1 from near | ms a frame |\n| --- | --- |')
    for name, changed in _CASES.items():
        film = SceneFilm(gas, replace(blurred, **changed))
        film.at(_FRAMES, 0)
        start = time.process_time()
        for number in range(_FRAMES + 1, 2 * _FRAMES + 1):
            film.at(number, 0)
        print(f'| {name} | {1e3 * (time.process_time() - start) / _FRAMES:.1f} |')


def write_picture(path: str) -> None:
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
    if len(sys.argv) > 1:
        write_picture(sys.argv[1])
    else:
        report()
