"""A picture as cameras of other encodings send it."""

from __future__ import annotations

import numpy as np


def mosaic(bgr, pattern):
    """The colours that a sensor with a filter in front of each pixel sees."""
    seen = np.empty(bgr.shape[:2], dtype=np.uint8)
    for place, colour in enumerate(pattern):
        row, column = divmod(place, 2)
        seen[row::2, column::2] = bgr[row::2, column::2, 'bgr'.index(colour)]
    return seen


def subsampled(bgr, *, luma_first):
    """4:2:2 YUV: luma of each pixel, colours of every second one (ITU-R BT.601)."""
    blue, green, red = (bgr[:, :, channel].astype(float) for channel in range(3))
    luma = 16.0 + 0.257 * red + 0.504 * green + 0.098 * blue
    colours = (
        128.0 - 0.148 * red - 0.291 * green + 0.439 * blue,
        128.0 + 0.439 * red - 0.368 * green - 0.071 * blue,
    )
    packed = np.empty((*bgr.shape[:2], 2), dtype=np.uint8)
    packed[:, :, 0 if luma_first else 1] = np.round(luma)
    for k, colour in enumerate(colours):
        packed[:, k::2, 1 if luma_first else 0] = np.round(colour[:, ::2])
    return packed


ENCODINGS = {
    'bgr8': (lambda bgr: bgr, 'bgr8'),
    'rgb8': (lambda bgr: bgr[:, :, ::-1], 'rgb8'),
    'mono8': (lambda bgr: bgr[:, :, 1], 'mono8'),
    'bgra8': (lambda bgr: np.dstack([bgr, np.full_like(bgr[:, :, 0], 7)]), 'bgr8'),
    'rgba8': (lambda bgr: np.dstack([bgr[:, :, ::-1], bgr[:, :, 0]]), 'rgb8'),
    '8UC3': (lambda bgr: bgr, 'bgr8'),
    '8UC1': (lambda bgr: bgr[:, :, 1], 'mono8'),
    'mono16': (lambda bgr: bgr[:, :, 1].astype('<u2') * 256 + 255, 'mono8'),
    'bayer_rggb8': (lambda bgr: mosaic(bgr, 'rggb'), 'bgr8'),
    'bayer_bggr8': (lambda bgr: mosaic(bgr, 'bggr'), 'bgr8'),
    'bayer_gbrg8': (lambda bgr: mosaic(bgr, 'gbrg'), 'bgr8'),
    'bayer_grbg8': (lambda bgr: mosaic(bgr, 'grbg'), 'bgr8'),
    'yuv422': (lambda bgr: subsampled(bgr, luma_first=False), 'bgr8'),
    'yuv422_yuy2': (lambda bgr: subsampled(bgr, luma_first=True), 'bgr8'),
}
"""How a BGR picture is sent, and the encoding of the frame that is made of it."""
