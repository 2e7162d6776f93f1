"""Beads lit from one side: how large they look, and how far towards the light.

Pictures of spheres at random places are drawn by `benchmarks.shaded_film`, which shares no code
with the package, compressed, and searched as a film is. Of each light, floor and size it prints
how many beads are found, the radius over the true one, and how far the centres are off towards
the light and across it, in radii.
``python -m benchmarks lit_beads``
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.shaded_film import EXPOSURES, LabCamera, Shading, write_shaded_film
from benchmarks.soft_spheres import SoftBox, SoftRun
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.scene_model import scene_model

_FRAMES, _LEARNING_FRAMES, _EVERY = 100, 25, 4
_SEEDS = 1, 2
_BEADS = 16
# A disc is right within this part of the radius of a bead.
_RIGHT = 0.35
# As told by eye: radii within this part.
_TOLD = 0.12
_WHITE, _YELLOW, _GRAY = (225.0, 232.0, 235.0), (60.0, 190.0, 230.0), (70.0, 72.0, 78.0)
_NAVY, _BLACK, _PAPER = (70.0, 40.0, 30.0), (20.0, 20.0, 20.0), (205.0, 213.0, 215.0)


class Scene(NamedTuple):
    """Radius [px], colours, elevation of the light [degrees], and what differs from the usual."""

    name: str
    radius: float = 15.0
    bead: tuple[float, float, float] = _WHITE
    floor: tuple[float, float, float] = _NAVY
    elevation: float = 58.0
    other: dict[str, float] = {}  # noqa: RUF012


SCENES = (
    Scene('white on navy'),
    Scene('yellow on navy, 10 px', radius=10.0, bead=_YELLOW),
    Scene('white on black', floor=_BLACK),
    Scene('as dark as the floor', floor=(46.0, 47.0, 48.0)),
    Scene('light at 30 degrees', elevation=30.0),
    Scene('light at 75 degrees', elevation=75.0),
    Scene('light from above', elevation=90.0),
    Scene('little other light', other={'ambient': 0.1}),
    Scene('much other light', other={'ambient': 0.6}),
    Scene('glossy', other={'highlight': 0.9, 'shine': 15.0}),
    Scene('dull', other={'highlight': 0.0}),
    Scene('6 px', radius=6.5),
    Scene('25 px', radius=25.0),
    Scene('blurred', other={'blur': 2.0}),
    Scene('noise, strong compression', other={'noise': 5.0, 'crf': 28.0}),
    Scene('no shadows', other={'shadow': 0.0}),
    Scene('gray on paper', bead=_GRAY, floor=_PAPER),
)


class Errors(NamedTuple):
    """Beads, discs, and of those that are right the errors, in radii: (n, 3).

    Columns: towards the light, across it, radius.
    """

    beads: int
    discs: int
    right: np.ndarray


def report() -> None:
    """Print a row for each scene."""
    print(
        '| scene | found | false | radius / true | towards the light | across | scatter '
        '| scatter of radii |'
    )
    print(f'{"| --- " * 8}|')
    for scene in SCENES:
        print(_row(scene), flush=True)


def _row(scene: Scene) -> str:
    parts = [errors(scene, seed) for seed in _SEEDS]
    right = np.concatenate([part.right for part in parts])
    beads, discs = (sum(part[k] for part in parts) for k in (0, 1))
    middle = np.median(right, axis=0)
    scatter = 1.4826 * np.median(np.abs(right - middle), axis=0)
    cells = (
        scene.name,
        f'{len(right) / beads:.3f}',
        f'{(discs - len(right)) / beads:.3f}',
        f'{1.0 + middle[2]:.3f}',
        f'{middle[0]:+.3f}',
        f'{middle[1]:+.3f}',
        f'{math.hypot(*scatter[:2]) / math.sqrt(2.0):.3f}',
        f'{scatter[2]:.3f}',
    )
    return f'| {" | ".join(cells)} |'


def errors(scene: Scene, seed: int) -> Errors:
    """How wrong is what is seen of a scene."""
    frames, truths, camera = drawn(scene, seed)
    radii = (1.0 - _TOLD) * scene.radius, (1.0 + _TOLD) * scene.radius
    model = scene_model(frames[:: _FRAMES // _LEARNING_FRAMES], BeadLook(radii=radii, apart=1.0))
    beads = discs = 0
    rows = []
    for frame, truth in zip(frames[1::_EVERY], truths[1::_EVERY], strict=True):
        candidates = model.candidates(frame)
        seen = candidates.outlines.discs[model.alike(candidates)]
        beads, discs = beads + len(truth), discs + len(seen)
        rows.append(_right(seen, truth, camera.light))
    return Errors(beads, discs, np.concatenate(rows))


def _right(seen: np.ndarray, truth: np.ndarray, light: tuple[float, float, float]) -> np.ndarray:
    away = seen[:, None, :2] - truth[None, :, :2]
    distances = np.hypot(away[..., 0], away[..., 1]) / truth[None, :, 2]
    rows, columns = linear_sum_assignment(np.minimum(distances, 1.0))
    near = distances[rows, columns] < _RIGHT
    rows, columns = rows[near], columns[near]
    off = (seen[rows] - truth[columns]) / truth[columns, 2:]
    turn = math.atan2(light[1], light[0])
    towards = off[:, 0] * math.cos(turn) + off[:, 1] * math.sin(turn)
    across = off[:, 1] * math.cos(turn) - off[:, 0] * math.sin(turn)
    return np.column_stack([towards, across, off[:, 2]])


def drawn(scene: Scene, seed: int) -> tuple[list[np.ndarray], list[np.ndarray], LabCamera]:
    """Frames, the discs (n, 3) that are seen in each, [px], and the camera."""
    random = np.random.default_rng([seed, 17])
    radius, scale = 1.25e-3, scene.radius / 1.25e-3
    sides = (20.0 * radius, 16.0 * radius, 3.2 * radius)
    size = tuple(2 * round(0.5 * scale * side) + 80 for side in sides[:2])
    turn, lift = random.uniform(0.0, 2.0 * math.pi), math.radians(scene.elevation)
    flat = math.cos(lift)
    camera = LabCamera(
        size=size,
        scale=scale,
        centre=(0.5 * size[0], 0.5 * size[1]),
        rate=30.0,
        light=(flat * math.cos(turn), flat * math.sin(turn), math.sin(lift)),
        ambient=0.3,
        floor=scene.floor,
        beads=(scene.bead,),
        texture=0.06,
        noise=2.0,
        blur=1.0,
        seed=seed,
    )
    camera = replace(camera, **scene.other)
    box = SoftBox(sides=sides, radii=(radius,) * _BEADS, masses=(1.0,) * _BEADS)
    places = np.stack([_places(box, random) for _ in range(_FRAMES)])
    states = np.repeat(places, EXPOSURES, axis=0)
    run = SoftRun(
        positions=states,
        velocities=np.zeros_like(states),
        displacement=np.zeros((len(states), 2)),
        collisions=0,
    )
    species = np.zeros(_BEADS, dtype=int)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'film.mp4'
        write_shaded_film(path, run, box, species, camera)
        film = cv2.VideoCapture(str(path))
        frames = [film.read()[1] for _ in range(_FRAMES)]
    seen, scales = Shading(box, species, camera).seen(places)
    truths = [
        np.column_stack([centres, radius * own]) for centres, own in zip(seen, scales, strict=True)
    ]
    return frames, truths, camera


def _places(box: SoftBox, random: np.random.Generator) -> np.ndarray:
    """Places at which no two spheres overlap, (count, 3), [m]."""
    radius = box.radii[0]
    places: list[np.ndarray] = []
    while len(places) < len(box.radii):
        place = random.uniform(radius, np.array(box.sides) - radius)
        if all(np.linalg.norm(place[:2] - other[:2]) > 1.9 * radius for other in places):
            places.append(place)
    return np.array(places)
