"""A decoded frame of a video, with square pixels and upright.

Tested by ``test/studies/film_import/test_import_times.py``.
"""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.recordings.film.display_rotation import Rotation, rotated

if TYPE_CHECKING:
    from numpy.typing import NDArray


class VideoPicture:
    """A decoded frame; colours are converted on demand.

    Parameters
    ----------
    frame : object of PyAV
    square : tuple of int, [px]
        Width and height with square pixels, before the rotation.
    rotation : tuple of int
        As returned by `rotation_of`.
    """

    def __init__(self, frame: Any, square: tuple[int, int], rotation: Rotation) -> None:
        self._frame = frame
        self._square = square
        self._rotation = rotation
        self._gray: NDArray[np.uint8] | None = None
        # Two threads that convert the same frame deadlock in PyAV.
        self._converting = Lock()

    def gray(self) -> NDArray[np.uint8]:
        """Brightness, (height, width), neither stretched nor rotated."""
        with self._converting:
            if self._gray is None:
                self._gray = self._brightness()
            return self._gray

    def _brightness(self) -> NDArray[np.uint8]:
        plane, name = self._frame.planes[0], self._frame.format.name
        if (name.startswith(('yuv4', 'yuvj4')) and name.endswith('p')) or name in ('gray', 'nv12'):
            rows = np.frombuffer(plane, np.uint8)
            rows = rows.reshape(plane.height, plane.line_size)
            return rows[: self._frame.height, : self._frame.width]
        return np.asarray(self._frame.to_ndarray(format='gray'))

    def pixels(self) -> NDArray[np.uint8]:
        """Pixels, square and upright: (height, width, 3), bgr, or (height, width), gray."""
        pixel_format = 'gray' if self._frame.format.name.startswith('gray') else 'bgr24'
        with self._converting:
            pixels = np.asarray(self._frame.to_ndarray(format=pixel_format))
        if pixels.shape[1::-1] != self._square:
            pixels = cv2.resize(pixels, self._square, interpolation=cv2.INTER_CUBIC)
        return rotated(np.asarray(pixels, dtype=np.uint8), self._rotation)
