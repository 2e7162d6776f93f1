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
