"""A picture of a video: decoded, with square pixels, upright."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.recordings.film.display_rotation import Turn, turned

if TYPE_CHECKING:
    from numpy.typing import NDArray


class VideoPicture:
    """A decoded frame; its colours are worked out when they are asked for.

    Parameters
    ----------
    frame : object of PyAV
    square : tuple of int, [px]
        Width and height with which its pixels are square, before it is turned.
    turn : tuple of int
        As `turn_of` finds it.
    """

    def __init__(self, frame: Any, square: tuple[int, int], turn: Turn) -> None:
        self._frame = frame
        self._square = square
        self._turn = turn
        self._gray: NDArray[np.uint8] | None = None
        # Two threads that convert one frame at a time wait for each other for ever.
        self._converting = Lock()

    def gray(self) -> NDArray[np.uint8]:
        """Its brightness, to compare it with others, (height, width), as it is stored."""
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
        """Its pixels, square and upright: bgr, or gray with two axes."""
        form = 'gray' if self._frame.format.name.startswith('gray') else 'bgr24'
        with self._converting:
            pixels = np.asarray(self._frame.to_ndarray(format=form))
        if pixels.shape[1::-1] != self._square:
            pixels = cv2.resize(pixels, self._square, interpolation=cv2.INTER_CUBIC)
        return turned(np.asarray(pixels, dtype=np.uint8), self._turn)
