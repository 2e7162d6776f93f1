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
# Blue, green, red and opacity of the outlines of what moves.
_MOVING = (60, 190, 255, 255)
# The outlines are drawn larger than the mask, which is coarse.
_FINER = 3
# Smoothing of the outlines, and the smallest area that has one, [px] and [px^2] of the mask.
_SMOOTH_PX, _SPECK = 1.5, 12.0


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
    """Smooth outlines of what moves; a fill would hide the beads."""
    rows, columns = mask.shape[:2]
    finer = _FINER if max(rows, columns) * _FINER <= _LARGEST_PX * 2 else 1
    moving = np.where(mask > 0, 255, 0).astype(np.uint8)
    smooth = cv2.GaussianBlur(moving, (0, 0), _SMOOTH_PX)
    size = finer * columns, finer * rows
    large = cv2.resize(smooth, size, interpolation=cv2.INTER_LINEAR)
    _, inside = cv2.threshold(large, 127, 255, cv2.THRESH_BINARY)
    outlines, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    kept = [outline for outline in outlines if cv2.contourArea(outline) >= _SPECK * finer**2]
    picture = np.empty((*inside.shape, 4), dtype=np.uint8)
    picture[...] = _MOVING
    opacity = np.zeros_like(inside)
    cv2.polylines(opacity, kept, True, (255,), 1, cv2.LINE_AA)
    picture[..., 3] = opacity
    _, content = cv2.imencode('.png', picture, [cv2.IMWRITE_PNG_COMPRESSION, 2])
    return content.tobytes()
