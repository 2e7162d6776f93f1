"""Photographs as files: PNG, which keeps every pixel, or JPEG, which is a tenth as large.

Tested by ``test/studies/synthetic/test_film_scene.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.atomic_files import write_bytes

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

PHOTOGRAPHS = '.png', '.jpg'
"""Endings of their files."""

_OPTIONS = {
    '.png': (cv2.IMWRITE_PNG_COMPRESSION, 9),
    '.jpg': (cv2.IMWRITE_JPEG_QUALITY, 88),
}


def write_photograph(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write a picture, complete or not at all.

    Parameters
    ----------
    path : Path
        ``.png`` or ``.jpg``; a file there is replaced.
    picture : ndarray of uint8, (rows, columns, 3)
        Blue, green, red.

    Raises
    ------
    RecordingError
        When it cannot be written.
    """
    if path.suffix not in PHOTOGRAPHS:
        endings = ' or '.join(PHOTOGRAPHS)
        raise RecordingError(str(path), 'is no file of a picture', f'end it in {endings}')
    _, content = cv2.imencode(path.suffix, picture, _OPTIONS[path.suffix])
    write_bytes(path, content.tobytes())


def write_words(
    picture: NDArray[np.uint8],
    words: str,
    place: tuple[int, int],
    size: float,
    colour: tuple[int, int, int],
) -> None:
    """Write words into a picture, on a black ground on which they can be read everywhere.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns, 3)
        Blue, green, red; it is changed.
    words : str
    place : tuple of int, [px]
        Column and row of the lower left corner of the letters.
    size : float
        Scale of the font.
    colour : tuple of int
        Blue, green, red.
    """
    # An outline by thicker letters, drawn first, does not fit: OpenCV 5 makes bold ones wider.
    font, (column, row) = cv2.FONT_HERSHEY_SIMPLEX, place
    (width, height), below = cv2.getTextSize(words, font, size, 1)
    corners = (column - 3, row - height - 3), (column + width + 3, row + below)
    cv2.rectangle(picture, *corners, (0, 0, 0), cv2.FILLED)
    cv2.putText(picture, words, place, font, size, colour, 1, cv2.LINE_AA)
