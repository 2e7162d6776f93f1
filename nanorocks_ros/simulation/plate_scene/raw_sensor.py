"""A sensor with colour filters: every pixel sees one colour, the others are interpolated.

Tested by ``test/simulation/plate_scene/test_varied_camera.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

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
    raw = np.empty(picture.shape[:2], dtype=np.uint8)
    for place, colour in enumerate(pattern):
        pixels = np.s_[place // 2 :: 2, place % 2 :: 2]
        raw[pixels] = picture[(*pixels, _CHANNELS.index(colour))]
    return np.asarray(cv2.demosaicing(raw, _CODES[pattern]), dtype=np.uint8)
