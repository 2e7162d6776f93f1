"""A container seen at an angle: a drawn film, tilted, rectified by its corners, and measured.

The film of `own_tray` is drawn once, tilted as by a pinhole camera at `_DISTANCE` times the width
of the tray, and measured by contacts alone, without the limit of the command. Beads are drawn on
the floor: what their height adds is not in it.
"""

from __future__ import annotations

import csv
import io
import math
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

import cv2
import numpy as np

from benchmarks.own_tray import SCALE, SIZE, TRAY
from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.oblique_view import Perspective
from nanorocks_ros.studies.measure import film_tray

# How much shorter the far side is than the near one.
_SHORTER = (0.0, 0.05, 0.1, 0.2, 0.3)
_DISTANCE = 2.5
_SIDES_MM = 90.0, 60.0
_RATE, _SECONDS = 30, 20
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
    print('| far side | scales | seen | speed | beads | walls |')
    print('| --- ' * 6 + '|')
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'steel.yaml').write_text(TRAY)
        film = folder / 'film.avi'
        _run(*_FILM, '--trays-file', str(folder / 'steel.yaml'), '--video', str(film))
        straight = None
        for shorter in _SHORTER:
            corners, stretch = _tilted(film, folder / f'tilted_{shorter:g}.avi', shorter)
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
            row = f'{-shorter:.0%} | {stretch:.3f} | {seen:.2f} | {ratio:.4f} | {beads} | {walls}'
            print(f'| {row} |', flush=True)


def _run(*arguments: str) -> None:
    with redirect_stdout(io.StringIO()):
        code = main(list(arguments))
    if code not in (0, 3):
        raise SystemExit(f'nanorocks {" ".join(arguments)}: {code}')


def _tilted(film: Path, path: Path, shorter: float) -> tuple[np.ndarray, float]:
    """Write the film as a tilted camera sees it; corners of the tray, ratio of its scales."""
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
    return corners, seen.stretch


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
