"""A sensor with colour filters: every pixel sees one colour, the others are interpolated.

Tested by ``test/simulation/plate_scene/test_optics.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# OpenCV names a pattern by the second row from the second column on.
_CODES = {
    'rggb': cv2.COLOR_BayerBG2BGR,
    'grbg': cv2.COLOR_BayerGB2BGR,
    'gbrg': cv2.COLOR_BayerGR2BGR,
    'bggr': cv2.COLOR_BayerRG2BGR,
}
_CHANNELS = 'bgr'


def through_filters(picture: NDArray[np.uint8], pattern: str) -> NDArray[np.uint8]:
    """A picture as a sensor with colour filters and bilinear interpolation shows it.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns, 3), bgr
        With the noise of the sensor, of which one value a pixel is used.
    pattern : str
        See `SceneSettings.bayer`.
    """
    if pattern == 'none':
        return picture
    channels = np.array([_CHANNELS.index(colour) for colour in pattern])
    raw = mosaic(picture, channels.reshape(2, 2))
    return np.asarray(cv2.demosaicing(raw, _CODES[pattern]), dtype=np.uint8)


@compiled
def mosaic(picture: NDArray[np.uint8], channels: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The value of every pixel in the channel of its filter.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns, 3)
    channels : ndarray of int64, (2, 2)
        Of the upper left pixels.

    Returns
    -------
    ndarray of uint8, (rows, columns)
    """
    rows, columns = picture.shape[:2]
    raw = np.empty((rows, columns), dtype=np.uint8)
    for i in range(rows):
        for j in range(columns):
            raw[i, j] = picture[i, j, channels[i & 1, j & 1]]
    return raw
