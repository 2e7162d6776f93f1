"""Overlay of bead tracks on a tray image, as in [B19] fig. 3c.

Tested by ``test/studies/analysis/test_bag_tracks.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.outputs.photographs import write_photograph, write_words

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks, TrayImage

# Colours of tracks, bgr, distinct from each other and from red, blue, copper and gray.
_COLOURS = (
    (80, 255, 120),
    (0, 235, 255),
    (255, 255, 90),
    (255, 255, 255),
    (90, 200, 255),
    (200, 255, 200),
)
_HIDDEN = (255, 0, 255)
MAGNIFICATION = 3
"""Pixels of an overlay for each of the image, unless told otherwise."""

# Fractional bits of the coordinates that are passed to OpenCV.
_SHIFT = 4
_GAP_PX = 12
# Width of the outline of a bead; paths are thinner.
_OUTLINE_PX = 2
_WHITE, _BLACK = (255, 255, 255), (0, 0, 0)


def overlay(
    image: TrayImage,
    tracks: Sequence[Tracks],
    pixels_per_metre: float,
    *,
    magnification: int = MAGNIFICATION,
    path_frames: int = 30,
) -> NDArray[np.uint8]:
    """Draw the beads of one image and their paths.

    Parameters
    ----------
    image : TrayImage
    tracks : sequence of Tracks
        Tracks up to and including those of the image.
    pixels_per_metre : float, [px/m]
        Scale of the image.
    magnification : int
    path_frames : int
        Length of the paths, in frames.

    Returns
    -------
    ndarray of uint8, (rows, columns, 3), bgr
        Hidden beads, whose positions are predicted, are magenta.
    """
    picture = image.gray if image.color is None else image.color
    large = cv2.resize(
        picture, None, fx=magnification, fy=magnification, interpolation=cv2.INTER_CUBIC
    )
    canvas: Any = large if large.ndim == 3 else cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    scale = magnification * pixels_per_metre * 2**_SHIFT
    if tracks:
        for number, positions in _paths(tracks[-path_frames:]).items():
            points = np.round(positions * scale - 2 ** (_SHIFT - 1)).astype(np.int32)
            cv2.polylines(canvas, [points], False, _colour(number), 1, cv2.LINE_AA, _SHIFT)
        _draw_beads(canvas, tracks[-1], scale)
    return np.asarray(canvas, dtype=np.uint8)


def with_scale_bar(picture: NDArray[np.uint8], pixels_per_metre: float) -> NDArray[np.uint8]:
    """The picture with a bar of a round length in its lower left corner.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns, 3), bgr
    pixels_per_metre : float, [px/m]
        Scale of the picture itself, with its magnification.
    """
    from nanorocks_ros.outputs.figure_style import bar_length

    rows, columns = picture.shape[:2]
    length = bar_length(1e3 * columns / pixels_per_metre)
    canvas: Any = picture.copy()
    left, bottom = columns // 25, rows - rows // 25
    right, size = left + round(1e-3 * length * pixels_per_metre), max(columns / 1000.0, 0.7)
    for colour, thickness in ((_BLACK, 7), (_WHITE, 3)):
        cv2.line(canvas, (left, bottom), (right, bottom), colour, thickness)
    write_words(canvas, f'{length:g} mm', (left, bottom - 10), size, _WHITE)
    return np.asarray(canvas, dtype=np.uint8)


def write_overlay(path: Path, pictures: Sequence[NDArray[np.uint8]]) -> None:
    """Write several overlays, stacked vertically, as PNG or JPEG.

    Raises
    ------
    RecordingError
        If the file cannot be written.
    """
    width = max(picture.shape[1] for picture in pictures)
    parts = [
        cv2.copyMakeBorder(picture, 0, _GAP_PX, 0, width - picture.shape[1], cv2.BORDER_CONSTANT)
        for picture in pictures
    ]
    write_photograph(path, np.vstack(parts)[:-_GAP_PX].astype(np.uint8, copy=False))


def _colour(number: int) -> tuple[int, int, int]:
    return _COLOURS[number % len(_COLOURS)]


def _paths(tracks: Sequence[Tracks]) -> dict[int, NDArray[np.float64]]:
    """Positions of each bead of the last record, in order of time, [m]."""
    paths: dict[int, list[NDArray[np.float64]]] = {int(number): [] for number in tracks[-1].ids}
    for record in tracks:
        for number, position in zip(record.ids.tolist(), record.positions, strict=True):
            if number in paths:
                paths[number].append(position)
    return {number: np.array(positions) for number, positions in paths.items()}


def _draw_beads(canvas: NDArray[np.uint8], tracks: Tracks, scale: float) -> None:
    columns = (tracks.ids.tolist(), tracks.positions, tracks.radii.tolist(), tracks.seen.tolist())
    for number, position, radius, seen in zip(*columns, strict=True):
        centre = [round(float(axis) * scale - 2 ** (_SHIFT - 1)) for axis in position]
        colour = _colour(number) if seen else _HIDDEN
        outline = round(radius * scale), colour, _OUTLINE_PX, cv2.LINE_AA, _SHIFT
        cv2.circle(canvas, centre, *outline)
