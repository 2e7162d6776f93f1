"""Pictures of a plate with trays at known positions, with or without a lens."""

from __future__ import annotations

import cv2
import numpy as np

from nanorocks_ros.experiment.plate import regions_on_plate
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Frame
from nanorocks_ros.settings import PipelineSettings, with_values

NS = 1_000_000_000
SCALE = 4800.0
SHAPE = (420, 640)
# Drawn so much finer than it is seen.
FINE = 4
BORDER = 60
WALL = 0.0006


class Plate:
    """A plate with all eight trays; frames of it, moved, lit and noisy as asked."""

    def __init__(self, camera=None, shape=SHAPE, scale=SCALE):
        self.shape, self.scale, self.camera = shape, scale, camera
        self.trays = load_trays()
        self.regions = regions_on_plate(self.trays.values(), shape, scale)
        self._fine = self._drawn()
        x, y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
        places = np.stack([x, y], axis=-1)
        self._places = places if camera is None else camera.rectified(places)

    def _drawn(self):
        rows, columns = ((side + 2 * BORDER) * FINE for side in self.shape)
        rng = np.random.default_rng(7)
        texture = cv2.GaussianBlur(rng.normal(0, 1, (rows, columns)), (0, 0), 2.0 * FINE)
        canvas = 110.0 + 25.0 * texture
        rim = round(WALL * self.scale * FINE)
        for x, y, width, height in self.regions.values():
            left, top = (x + BORDER) * FINE, (y + BORDER) * FINE
            right, bottom = left + width * FINE, top + height * FINE
            canvas[top - rim : bottom + rim, left - rim : right + rim] *= 0.5
            canvas[top:bottom, left:right] = 160.0
        return cv2.GaussianBlur(canvas, (0, 0), 0.7 * FINE).astype(np.float32)

    def picture(self, shift=(0.0, 0.0), *, beads=None, light=1.0, noise=2.0, seed=0):
        """The plate moved by a shift [px]; beads are dark discs, (x, y, radius) [px], unmoved."""
        at = ((self._places - np.array(shift) + BORDER) * FINE - 0.5).astype(np.float32)
        gray = cv2.remap(self._fine, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        for x, y, radius in () if beads is None else beads:
            away = np.hypot(self._places[..., 0] - x, self._places[..., 1] - y)
            gray = np.where(away < radius, 60.0, gray)
        rng = np.random.default_rng(seed)
        pixels = light * gray[..., np.newaxis] * (0.97, 1.0, 1.03)
        pixels = pixels + rng.normal(0.0, noise, pixels.shape)
        return np.clip(np.rint(pixels), 0, 255).astype(np.uint8)

    def frame(self, number=0, shift=(0.0, 0.0), **values):
        """A frame at 30 Hz; the noise of each is its own."""
        image = self.picture(shift, seed=number, **values)
        return Frame(stamp_ns=number * NS // 30, encoding='bgr8', image=image)


def settings(**values):
    """All trays of such a plate."""
    common = {
        'trays': list(range(1, 9)),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
    }
    return with_values(PipelineSettings(), {**common, **values}, 'test')


class GrowingFloor:
    """A bright floor in a dark wall, for a camera that zooms."""

    shape = 200, 260
    floor = 60, 50, 140, 100
    wall = 7

    def picture(self, number, rate, shift=(0.0, 0.0)):
        """The picture with a number, which is by so much larger than the one before it."""
        height, width = self.shape
        x, y, across, down = self.floor
        still = np.full((height, width, 3), 120.0)
        wall = self.wall
        still[y - wall : y + down + wall, x - wall : x + across + wall] = 40.0
        still[y : y + down, x : x + across] = 180.0
        still = cv2.GaussianBlur(still, (0, 0), 1.2)
        centre = 0.5 * width + 5.0, 0.5 * height - 20.0
        zoom = cv2.getRotationMatrix2D(centre, 0.0, 1.0 + rate * number)
        zoom[:, 2] += shift
        grown = cv2.warpAffine(still, zoom, (width, height), borderMode=cv2.BORDER_REPLICATE)
        noise = np.random.default_rng(number).normal(0.0, 2.0, grown.shape)
        return (grown + noise).round().clip(0, 255).astype(np.uint8)


GROWING_FLOOR = GrowingFloor()
