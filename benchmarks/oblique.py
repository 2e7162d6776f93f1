"""A container seen at an angle: a drawn film, tilted, rectified by its corners, and measured.

The film of `own_tray` is drawn once, tilted as by a pinhole camera at `_DISTANCE` times the width
of the tray, and measured by contacts alone, without the limit of the command. Beads are drawn on
the floor: what their height adds is not in it. Balls, which are round in the film and rectified to
ellipses, are detected in drawn films that are rectified as seen at an angle.
"""

from __future__ import annotations

import csv
import io
import math
import tempfile
from contextlib import redirect_stdout
from dataclasses import replace
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

from benchmarks.drawn_scenes import SCENES, draw
from benchmarks.own_tray import SCALE, SIZE, TRAY
from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.oblique_view import Perspective
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector
from nanorocks_ros.studies.measure import film_tray

# How much shorter the far side is than the near one.
_SHORTER = (0.0, 0.05, 0.1, 0.2)
_DISTANCE = 2.5
_SIDES_MM = 90.0, 60.0
_RATE, _SECONDS = 30, 20
# Balls: films, radius [px], angles, part of the picture's scale, and a ball is seen within [px].
_FILMS = 'dark on gray', 'bright on dark', 'dark shadows'
_RADIUS, _ANGLES, _FILLED, _NEAR = 12.0, (0, 11, 23, 30, 40), 0.9, 3.0
# Speeds count from here on, [s].
_AFTER = 1.5
_FILM = (
    *('simulate', '--tray', '1', '--duration', f'{_SECONDS}', '--mean-speed', '0.02'),
    *('--restitution', '0.85', '--wall-restitution', '0.93', '--seed', '5'),
    *('--width-px', f'{SIZE[0]}', '--height-px', f'{SIZE[1]}', '--pixels-per-metre', f'{SCALE}'),
)


def report() -> None:
    """Draw the film, tilt and measure it; print a row for each angle."""
    film_tray.MAX_STRETCH = math.inf
    print('| far side | angle | scales | seen | speed | beads | walls |')
    print('| --- ' * 7 + '|')
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'steel.yaml').write_text(TRAY)
        film = folder / 'film.avi'
        _run(*_FILM, '--trays-file', str(folder / 'steel.yaml'), '--video', str(film))
        straight = None
        for shorter in _SHORTER:
            corners, stretch, angle = _tilted(film, folder / f'tilted_{shorter:g}.avi', shorter)
            out = folder / f'out_{shorter:g}'
            numbers = [f'{value:.2f}' for value in corners.ravel()]
            sides = [f'{side:g}' for side in _SIDES_MM]
            _run(
                *('measure', str(folder / f'tilted_{shorter:g}.avi'), '--corners', *numbers),
                *('--sides-mm', *sides, '--height-mm', '4', '--diameter-px', '24'),
                *('--diameter-mm', '3', '-o', str(out)),
            )
            seen, speeds = _speeds(out)
            straight = speeds if straight is None else straight
            ratio = np.median(speeds / straight)
            beads, walls = _restitutions(out)
            row = f'{-shorter:.0%} | {angle:.0f}° | {stretch:.3f} | {seen:.2f} | {ratio:.4f}'
            row = f'{row} | {beads} | {walls}'
            print(f'| {row} |', flush=True)

    print()
    _report_balls()


def _report_balls() -> None:
    """Print how balls are seen in films that are rectified; places in px of the film."""
    print('| film | angle | scales | seen | rms [px] | radii [px] |')
    print('| --- ' * 6 + '|')
    for name, angle in product(_FILMS, _ANGLES):
        scene = replace(SCENES[name], radii=(_RADIUS, _RADIUS), count=20, frames=30)
        frames, truth = draw(scene)
        seen_at = _view(scene.size, angle)
        seen, off, radii = _balls(frames, truth, seen_at)
        rms = math.sqrt(np.mean(np.square(off)))
        print(
            f'| {name} | {angle}° | {seen_at.stretch:.2f} | {seen:.3f} | {rms:.2f} '
            f'| {np.median(radii):.2f} ± {np.std(radii):.2f} |',
            flush=True,
        )


def _view(size: tuple[int, int], angle: float) -> Perspective:
    """A rectangle seen at an angle, [degrees], that fills most of the picture."""
    sine, cosine = math.sin(math.radians(angle)), math.cos(math.radians(angle))
    width, height = 0.95 * size[0], 0.93 * size[1] / cosine
    ends = 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [width, height]
    depth = 1.0 - ends[:, 1] * sine / (_DISTANCE * width)
    corners = np.array(size) / 2.0 + _FILLED * ends * [1.0, cosine] / depth[:, None]
    return Perspective(
        tuple((float(x), float(y)) for x, y in corners), (round(width), round(height))
    )


def _balls(frames, truth, seen_at: Perspective) -> tuple[float, np.ndarray, np.ndarray]:
    """Share of the balls inside that are seen; distances and radii of these, [px]."""
    width, height = seen_at.size_px
    diameter = 2.0 * _RADIUS / _FILLED
    text = (
        f'trays:\n  1:\n    dimensions_mm: [{width}, {height}]\n    species:\n'
        f'      - {{diameter_mm: {diameter:.2f}, look: auto}}\n'
    )
    rectified = [seen_at.rectified(frame) for frame in frames]
    detector = SceneDetector(load_trays(text)[1], 1000.0)
    detector.learn(rectified)
    corners = np.array(seen_at.corners_px, dtype=np.float32)
    balls, off, radii = 0, [], []
    for frame, places in zip(rectified[::3], truth[::3], strict=True):
        beads = detector.detect(frame)[0]
        discs = seen_at.film_discs(np.column_stack([beads.positions, beads.radii]))
        inside = [
            cv2.pointPolygonTest(corners, (x + 0.5, y + 0.5), True) > _RADIUS + 1.0
            for x, y, _ in places.tolist()
        ]
        balls += sum(inside)
        if len(discs):
            away, nearest = cKDTree(discs[:, :2] - 0.5).query(places[inside, :2])
            off.append(away[away < _NEAR])
            radii.append(discs[nearest[away < _NEAR], 2])
    return sum(map(len, off)) / balls, np.concatenate(off), np.concatenate(radii)


def _run(*arguments: str) -> None:
    with redirect_stdout(io.StringIO()):
        code = main(list(arguments))
    if code not in (0, 3):
        raise SystemExit(f'nanorocks {" ".join(arguments)}: {code}')


def _tilted(film: Path, path: Path, shorter: float) -> tuple[np.ndarray, float, float]:
    """Write the film as a tilted camera sees it; corners of the tray, ratio of scales, angle."""
    columns, rows = SIZE
    width, height = (SCALE * side * 1e-3 for side in _SIDES_MM)
    half = np.array([width, height]) / 2.0
    ends = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    middle = np.array([columns, rows]) / 2.0
    away = _DISTANCE * width
    # (away - y sin) over (away + y sin) is the ratio of the two sides.
    sine = away / half[1] * shorter / (2.0 - shorter)
    cosine = math.sqrt(1.0 - sine**2)
    depth = away - ends[:, 1] * sine
    corners = middle + ends * [1.0, cosine] * (away / depth)[:, None]
    corners = middle + (corners - middle) * (0.97 if shorter else 1.0)
    matrix = cv2.getPerspectiveTransform(
        np.float32(middle + ends - 0.5), np.float32(corners - 0.5)
    )
    source = cv2.VideoCapture(str(film))
    target = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), _RATE, SIZE)
    target.set(cv2.VIDEOWRITER_PROP_QUALITY, 95)
    while True:
        there, frame = source.read()
        if not there:
            break
        target.write(cv2.warpPerspective(frame, matrix, SIZE, flags=cv2.INTER_CUBIC))
    target.release()
    order = tuple((float(x), float(y)) for x, y in corners)
    seen = Perspective(order, (round(width), round(height)))
    return corners, seen.stretch, math.degrees(math.asin(sine))


def _speeds(out: Path) -> tuple[float, np.ndarray]:
    """Beads seen in a frame, and mean speeds once the tray was shaken."""
    with (out / 'tracks.csv').open() as stream:
        rows = list(csv.DictReader(stream))
    seen = sum(row['seen'] == 'true' for row in rows) / len({row['frame'] for row in rows})
    with (out / 'tray_1_mean_speeds.csv').open() as stream:
        table = [row for row in csv.DictReader(stream) if float(row['time']) > _AFTER]
    return seen, np.array([float(row['mean_speed'] or 'nan') for row in table])


def _restitutions(out: Path) -> tuple[str, str]:
    """What contacts say of beads and of all walls."""
    with (out / 'tray_1_restitutions.csv').open() as stream:
        rows = {row['partner']: row for row in csv.DictReader(stream)}
    return _measured(rows['beads']), _measured(rows['walls'])


def _measured(row: dict[str, str]) -> str:
    value, error = float(row['restitution']), float(row['restitution_error'])
    return f'{value:.4f} ± {error:.4f} by {row["contacts"]}'


if __name__ == '__main__':
    report()
