"""The picture of a tray with its tracks drawn over it, as in [B19] fig. 3c."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks, TrayImage

# Colours of tracks, bgr, apart from each other and from red, blue, copper and gray.
_COLOURS = (
    (80, 255, 120),
    (0, 235, 255),
    (255, 255, 90),
    (255, 255, 255),
    (90, 200, 255),
    (200, 255, 200),
)
_HIDDEN = (255, 0, 255)
# Parts of a pixel in which OpenCV takes coordinates, as a power of two.
_SHIFT = 4
_GAP_PX = 12


def overlay(
    image: TrayImage,
    tracks: Sequence[Tracks],
    pixels_per_metre: float,
    *,
    magnification: int = 3,
    path_frames: int = 30,
) -> NDArray[np.uint8]:
    """Draw the beads of one picture, and the ways they came.

    Parameters
    ----------
    image : TrayImage
    tracks : sequence of Tracks
        Up to and with that of the image.
    pixels_per_metre : float, [px/m]
        Of the image.
    magnification : int
    path_frames : int
        Length of the ways drawn, in pictures.

    Returns
    -------
    ndarray of uint8, (rows, columns, 3), bgr
        Beads that are hidden, and so predicted, are magenta.
    """
    picture = image.gray if image.color is None else image.color
    large = cv2.resize(
        picture, None, fx=magnification, fy=magnification, interpolation=cv2.INTER_CUBIC
    )
    canvas: Any = large if large.ndim == 3 else cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    scale = magnification * pixels_per_metre * 2**_SHIFT
    if tracks:
        for number, way in _ways(tracks[-path_frames:]).items():
            points = np.round(way * scale - 2 ** (_SHIFT - 1)).astype(np.int32)
            cv2.polylines(canvas, [points], False, _colour(number), 1, cv2.LINE_AA, _SHIFT)
        _draw_beads(canvas, tracks[-1], scale)
    return np.asarray(canvas, dtype=np.uint8)


def write_overlay(path: Path, pictures: Sequence[NDArray[np.uint8]]) -> None:
    """Write overlays below each other, as a PNG.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    width = max(picture.shape[1] for picture in pictures)
    parts = [
        cv2.copyMakeBorder(picture, 0, _GAP_PX, 0, width - picture.shape[1], cv2.BORDER_CONSTANT)
        for picture in pictures
    ]
    encoded, content = cv2.imencode('.png', np.vstack(parts)[:-_GAP_PX])
    if not encoded:
        raise RecordingError(str(path), 'the picture cannot be encoded', 'name a .png file')
    with atomic_file(path) as part:
        part.write_bytes(content.tobytes())


def _colour(number: int) -> tuple[int, int, int]:
    return _COLOURS[number % len(_COLOURS)]


def _ways(tracks: Sequence[Tracks]) -> dict[int, NDArray[np.float64]]:
    """Places of each bead of the last picture, in order, [m]."""
    ways: dict[int, list[NDArray[np.float64]]] = {int(one): [] for one in tracks[-1].ids}
    for record in tracks:
        for number, place in zip(record.ids.tolist(), record.positions, strict=True):
            if number in ways:
                ways[number].append(place)
    return {number: np.array(way) for number, way in ways.items()}


def _draw_beads(canvas: NDArray[np.uint8], tracks: Tracks, scale: float) -> None:
    columns = (tracks.ids.tolist(), tracks.positions, tracks.radii.tolist(), tracks.seen.tolist())
    for number, place, radius, seen in zip(*columns, strict=True):
        centre = [round(float(one) * scale - 2 ** (_SHIFT - 1)) for one in place]
        colour = _colour(number) if seen else _HIDDEN
        cv2.circle(canvas, centre, round(radius * scale), colour, 1, cv2.LINE_AA, _SHIFT)
