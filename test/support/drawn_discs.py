"""Frames of moving discs on a floor with noise."""

from __future__ import annotations

import cv2
import numpy as np

SIZE = 360, 240


def disc_frames(colours, count=8, *, frames=12, diameter=20.0, floor=170):
    """Frames of `count` discs that move, of the colours (bgr) in turn."""
    rng = np.random.default_rng(3)
    rows, columns = np.divmod(np.arange(count), 6)
    pictures = []
    for k in range(frames):
        image = np.full((SIZE[1], SIZE[0], 3), floor, dtype=np.uint8)
        for number, (row, column) in enumerate(zip(rows, columns, strict=True)):
            place = 40.0 + 50.0 * column + 1.9 * k, 45.0 + 55.0 * row + 0.7 * k
            centre = tuple(round(16.0 * (axis - 0.5)) for axis in place)
            colour = colours[number % len(colours)]
            cv2.circle(image, centre, round(8.0 * diameter), colour, -1, cv2.LINE_AA, 4)
        noise = rng.normal(0.0, 2.0, image.shape)
        pictures.append(np.clip(image + noise, 0, 255).astype(np.uint8))
    return pictures
