"""Images of trays, encoded for a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.recordings.messages.image_messages import encode_jpeg

if TYPE_CHECKING:
    from numpy.typing import NDArray

LAYERS = ('tray', 'tracks', 'motion')
"""What can be looked at: the tray, the tray with its tracks drawn in, and where it moves."""

_QUALITY = 80
_LARGEST_PX = 900
# Blue, green, red and opacity of moving pixels.
_MOVING = (60, 190, 255, 84)


def encoded(layer: str, image: NDArray[np.uint8]) -> bytes:
    """A picture as JPEG, or, of what moves, as a PNG that lies over another.

    Parameters
    ----------
    layer : str
        One of `LAYERS`.
    image : ndarray of uint8, (rows, columns[, 3]), bgr
    """
    if layer == 'motion':
        return _see_through(image)
    scale = _LARGEST_PX / max(image.shape[:2])
    picture: Any = image
    if scale < 1.0:
        # A narrow strip keeps at least one pixel.
        rows, columns = (max(1, round(scale * side)) for side in image.shape[:2])
        picture = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    return encode_jpeg(picture, _QUALITY)


def _see_through(mask: NDArray[np.uint8]) -> bytes:
    picture = np.zeros((*mask.shape[:2], 4), dtype=np.uint8)
    picture[mask > 0] = _MOVING
    _, content = cv2.imencode('.png', picture, [cv2.IMWRITE_PNG_COMPRESSION, 2])
    return content.tobytes()
