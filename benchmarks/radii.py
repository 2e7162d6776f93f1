"""Radii of the beads in single frames of drawn films and of films by other code, film by film.

Measured radii over true ones in pictures of the floor as `FilmTruth` says where it is, from the
detection alone: without tracks, which average them. A bead above the floor is nearer to a camera
at a finite height and seen larger; the truth is multiplied by that. Beads that move less than 1 px
during the exposure are counted. Films are those of ``python -m benchmarks foreign_world``.

Then the same in pictures of one drawn camera, before and after JPEG with colours at full and at
half resolution, of shaded and of flat beads: what makes radii large.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial import cKDTree

from benchmarks.film_truth import read_truth
from benchmarks.foreign_world import films_by_other_code, films_drawn
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings, TrackingSettings, with_values
from nanorocks_ros.simulation.plate_scene.drawn_camera import drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from benchmarks.film_truth import FilmTruth
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings
    from nanorocks_ros.simulation.plate_scene.drawn_camera import DrawnCamera

# Frames in a row at the start, and frames spread over so many seconds after them.
_FIRST, _SPREAD, _SECONDS = 8, 32, 14.0
# Largest motion during an exposure [px], and smallest visible share of an outline.
_SLOW_PX, _VISIBLE = 1.0, 0.6
# Largest distance of a detection from a bead, in radii.
_NEAR = 0.6
# Exposure of films that state none, of the time between frames.
_EXPOSURE = 0.5
# Camera whose pictures are compressed, the gas in them, and their number.
_CAMERA, _FRAMES = 4, 60
_SIMULATION = {'tray': 1, 'mean_speed': 2e-3, 'first_shake': 0.0}
_QUALITY = 95
_SAMPLING = cv2.IMWRITE_JPEG_SAMPLING_FACTOR
_JPEGS: dict[str, list[int] | None] = {
    'not compressed': None,
    'JPEG 4:4:4': [_SAMPLING, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444],
    'JPEG 4:2:0': [_SAMPLING, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420],
}


def report() -> None:
    """Print a row for each species of each film, and the summary of each tray."""
    print('| film | species | true radius [px] | perspective | measured / seen - 1 [%] | [px] |')
    print('| --- ' * 6 + '|')
    groups: dict[str, list[float]] = {}
    for name, videos in (('drawn', films_drawn()), ('by other code', films_by_other_code())):
        for video in videos:
            film = read_truth(video)
            for kind, (true, seen, found) in _radii(film).items():
                material = load_trays()[film.tray].species[kind].material
                ratio = float(np.median(found / seen)) - 1.0
                groups.setdefault(f'{name}, tray {film.tray}, {material}', []).append(ratio)
                print(
                    f'| {video.stem} | {material} | {np.median(true):.1f} '
                    f'| {np.median(seen / true):.4f} | {1e2 * ratio:+.2f} '
                    f'| {np.median(found - seen):+.3f} |',
                    flush=True,
                )
    print('\n| films | number | median [%] | rms [%] |\n| --- | --- | --- | --- |')
    for group, ratios in groups.items():
        rms = math.sqrt(np.mean(np.square(ratios)))
        print(f'| {group} | {len(ratios)} | {1e2 * np.median(ratios):+.2f} | {1e2 * rms:.2f} |')
    _print_causes()


def _print_causes() -> None:
    """Print what pictures with compressed colours do to radii."""
    tray = load_trays()[1]
    simulation = with_values(SimulationSettings(), _SIMULATION, 'benchmark')
    camera = drawn_camera(_CAMERA, tray, simulation)
    print('\n| pictures of tray 1 | shaded beads [px] | flat beads [px] |\n| --- | --- | --- |')
    errors = [
        _errors(camera, tray, replace(camera.scene, camera_height=0.0, shading=shading))
        for shading in (1.0, 0.0)
    ]
    for name in errors[0]:
        print(f'| {name} | {errors[0][name]:+.3f} | {errors[1][name]:+.3f} |', flush=True)


def _errors(camera: DrawnCamera, tray: Tray, scene: SceneSettings) -> dict[str, float]:
    """Median error of radii by how the pictures are compressed, [px]."""
    film = SceneFilm(camera.simulation, scene, {tray.number: tray})
    geometry = film.camera.geometry
    corner, sides = geometry.corner(tray.number), geometry.sides(tray.number)
    left, top, width, height = (round(float(side)) for side in (*corner, *sides))
    detectors = {
        name: BeadDetector(TrackingSettings(), tray, scene.pixels_per_metre) for name in _JPEGS
    }
    errors: dict[str, list[float]] = {name: [] for name in _JPEGS}
    for moment in film.moments(_FRAMES):
        for name, sampling in _JPEGS.items():
            image = moment.frame.image
            if sampling is not None:
                options = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY, *sampling]
                jpeg = cv2.imencode('.jpg', image, options)[1]
                image = np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), dtype=np.uint8)
            (beads,) = detectors[name].detect(image[top : top + height, left : left + width])
            seen = beads.radii[beads.visible_outline > _VISIBLE]
            true = 0.5 * tray.species[0].diameter * scene.pixels_per_metre
            errors[name] += (seen - true).tolist()
    return {name: float(np.median(values)) for name, values in errors.items()}


def _radii(film: FilmTruth) -> dict[int, tuple[NDArray[np.float64], ...]]:
    """True radii, those seen in perspective and measured ones, by species, [px]."""
    with np.load(film.video.with_suffix('.npz')) as archive:
        arrays = {name: archive[name] for name in ('P', 'V', 'box')}
        scene = json.loads(str(archive['settings']))['scene'] if 'settings' in archive else {}
        shifts = archive['C'] if 'C' in archive else np.zeros((len(arrays['P']), 2))
    exposure = scene.get('exposure', _EXPOSURE)
    middle = 0.5 * arrays['box'][:2] * film.scale
    blur = np.hypot(*np.moveaxis(arrays['V'][..., :2], -1, 0))
    blur *= film.scale * exposure / film.frame_rate
    detector = BeadDetector(TrackingSettings(), load_trays()[film.tray], film.scale)
    rows: dict[int, list[tuple[float, float, float]]] = {}
    for number, image in _images(film, arrays['box']):
        magnified = film.magnification[number]
        places = arrays['P'][number, :, :2] * film.scale - middle
        tree = cKDTree(middle + places * magnified[:, np.newaxis] + shifts[number])
        true = film.radii * film.scale
        for kind, beads in enumerate(detector.detect(image)):
            if not beads.radii.size:
                continue
            distances, nearest = tree.query(beads.positions)
            usable = (distances < _NEAR * true[nearest]) & (film.species[nearest] == kind)
            usable &= (blur[number, nearest] < _SLOW_PX) & (beads.visible_outline > _VISIBLE)
            bead = nearest[usable]
            seen = true[bead] * magnified[bead]
            measured = zip(true[bead], seen, beads.radii[usable], strict=True)
            rows.setdefault(kind, []).extend(measured)
    return {kind: tuple(np.array(rows[kind]).T) for kind in sorted(rows) if rows[kind]}


def _images(film: FilmTruth, box: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Pictures of the floor, with the numbers of their frames."""
    last = min(len(film.positions) - 1, int(_SECONDS * film.frame_rate))
    spread = np.linspace(_FIRST, last, _SPREAD).astype(int).tolist()
    wanted = {*range(_FIRST), *spread}
    capture = cv2.VideoCapture(str(film.video))
    for number in range(last + 1):
        if not capture.grab():
            break
        if number not in wanted:
            continue
        image = np.asarray(capture.retrieve()[1], dtype=np.uint8)
        left, top, width, height = _floor(film, box, image.shape)
        yield number, image[top : top + height, left : left + width]
    capture.release()


def _floor(film: FilmTruth, box: NDArray[np.float64], shape: tuple[int, ...]) -> list[int]:
    """Left, top, width and height of the floor in whole pixels; by default in the middle."""
    if film.region:
        return [round(side) for side in film.region]
    width, height = (round(side * film.scale) for side in box[:2])
    return [round(0.5 * (shape[1] - width)), round(0.5 * (shape[0] - height)), width, height]
