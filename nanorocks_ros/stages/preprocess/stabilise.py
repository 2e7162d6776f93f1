"""Displacement of a tray in each picture: it oscillates on its springs after it was shaken.

The walls around the floor are registered with a reference of earlier pictures; no bead ever lies
there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.stages.preprocess.image_registration import (
    register,
    sample,
    search_shift,
    update_reference,
)
from nanorocks_ros.stages.preprocess.rectify import places_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.view import View

# Number of points on edges along rows, and as many on edges along columns.
_POINTS = 250
_FEWEST_POINTS = 60
# Smallest slope above the noise, [gray levels/px], and share of the steepest that is as good.
_SMALLEST_SLOPE = 3.0
_STEEP = 0.3
# Distance from the floor within which it is blurred into the wall, [px].
_BLUR = 2
# Range of the search for a lost tray, and for one with a registered neighbour, [px].
_REACH = 16
_NARROW_REACH = 4
# Largest remaining difference, as a share of the contrast, and largest standard error, [px].
_LARGEST_RESIDUAL = 0.5
_LARGEST_ERROR = 0.2
# Error by the interpolation between pixels, [px]: measured on simulated oscillations.
_INTERPOLATION = 0.02
_FEWEST_TRAYS = 3
# Pictures averaged in the reference. The error of each moves it by a share of itself, and these
# add up: with 64 pictures it walked off by 5 px in 20 s of a compressed film that jitters.
_MEMORY = 1024


@dataclass(frozen=True, slots=True)
class Shift:
    """Displacement of a tray in the rectified picture.

    Parameters
    ----------
    x, y, error : float, [px]
        ``error`` is one standard error of each component.
    """

    x: float
    y: float
    error: float


def shift_of_plate(shifts: Sequence[Shift]) -> Shift | None:
    """Displacement of the plate: the median of three or more trays."""
    if len(shifts) < _FEWEST_TRAYS:
        return None
    return Shift(
        median([shift.x for shift in shifts]),
        median([shift.y for shift in shifts]),
        median([shift.error for shift in shifts]),
    )


class TrayRegistration:
    """Registers the walls of one tray from picture to picture.

    Parameters
    ----------
    region : Region
        Floor of the tray in the rectified picture.
    view : View
    wall_px : float, [px]
        Width of the wall.
    mix : ndarray of float64, (channels,)
        Weights of the channels of the pictures in their gray mix.
    """

    def __init__(
        self, region: Region, view: View, wall_px: float, mix: NDArray[np.float64]
    ) -> None:
        self._region = region
        self._view = view
        self._wall = max(4, math.ceil(wall_px))
        self._mix = mix
        self._places: NDArray[np.float64] | None = None
        self._slopes = self._reference = self._values = np.empty(0)
        self._trust = self._powers = np.empty(0)
        self._seen = 0
        self._last = Shift(0.0, 0.0, 0.0)

    def push(self, image: NDArray[np.uint8], hint: Shift | None) -> Shift | None:
        """Displacement of the tray in the next picture.

        Parameters
        ----------
        image : ndarray of uint8, (height, width, channels)
        hint : Shift or None
            That of another tray on the same plate, in the same picture.

        Returns
        -------
        Shift or None
            From its position in the first picture; None when the walls are not seen.
        """
        if self._places is None:
            return self._choose_points(image)
        if self._reference.size == 0:
            return None
        first = self._last if hint is None else hint
        shift = self._registered(image, (first.x, first.y))
        if shift is None:
            reach = _REACH if hint is None else _NARROW_REACH
            few = slice(None, None, 4)
            start = search_shift(
                image,
                self._mix,
                np.ascontiguousarray(self._places[few]),
                np.ascontiguousarray(self._reference[few]),
                (first.x, first.y),
                reach,
            )
            shift = self._registered(image, start)
        if shift is None:
            return None
        self._last = shift
        # The average has less noise than a single picture.
        self._seen = min(self._seen + 1, _MEMORY)
        update_reference(self._values, self._seen, self._reference, self._powers, self._trust)
        return shift

    @property
    def has_walls(self) -> bool:
        """Whether there are walls by which the tray can be registered."""
        return self._reference.size > 0

    def set_shift(self, shift: Shift) -> None:
        """Set the true displacement in the last picture."""
        self._last = shift

    def _registered(self, image: NDArray[np.uint8], start: tuple[float, float]) -> Shift | None:
        assert self._places is not None
        result = np.empty(5)
        done = register(
            image,
            self._mix,
            self._places,
            self._reference,
            self._slopes,
            self._trust,
            start,
            result,
            self._values,
        )
        if not done or not np.isfinite(result).all():
            return None
        x, y, error, spread, contrast = (float(number) for number in result)
        if spread > _LARGEST_RESIDUAL * contrast or error > _LARGEST_ERROR:
            return None
        return Shift(x, y, math.hypot(error, _INTERPOLATION))

    def _choose_points(self, image: NDArray[np.uint8]) -> Shift | None:
        """Choose the points to register; None when the walls have too few edges."""
        points, slopes = self._edges(image)
        self._places = places_of(points, self._view)
        self._slopes = slopes
        self._reference = np.empty(len(points))
        self._values = np.empty(len(points))
        self._powers, self._trust = np.ones(len(points)), np.ones(len(points))
        if not len(points):
            return None
        sample(image, self._mix, self._places, (0.0, 0.0), self._reference)
        self._seen = 1
        return self._registered(image, (0.0, 0.0))

    def _edges(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        region, margin = self._region, self._wall + 2
        rows, columns = region.height + 2 * margin, region.width + 2 * margin
        x = region.x - margin + 0.5 + np.arange(columns)
        y = region.y - margin + 0.5 + np.arange(rows)
        grid = np.stack(np.meshgrid(x, y), axis=-1)
        # Without the derivatives of `places_of`, which here take five times as long.
        places = np.zeros((rows, columns, 6))
        places[..., :2] = self._view.source(grid)
        gray = np.empty(rows * columns)
        sample(image, self._mix, places.reshape(-1, 6), (0.0, 0.0), gray)
        # Points are chosen in the smoothed picture, but registered by the slopes of the original.
        smooth = cv2.GaussianBlur(gray.reshape(rows, columns), (3, 3), 0.0)
        steepness = np.stack(np.gradient(smooth)[::-1], axis=-1)
        slopes = np.stack(np.gradient(gray.reshape(rows, columns))[::-1], axis=-1)
        usable = np.zeros((rows, columns), dtype=bool)
        usable[1:-1, 1:-1] = True
        inner = margin - _BLUR
        usable[inner : rows - inner, inner : columns - inner] = False
        height, width = image.shape[:2]
        usable &= (places[..., 0] >= 1.0) & (places[..., 0] <= width - 1.0)
        usable &= (places[..., 1] >= 1.0) & (places[..., 1] <= height - 1.0)
        chosen = [_steepest(np.abs(steepness[..., axis]), usable) for axis in (0, 1)]
        if min(len(points) for points in chosen) < _FEWEST_POINTS:
            return np.empty((0, 2)), np.empty((0, 2))
        pixels = np.unique(np.concatenate(chosen))
        return grid.reshape(-1, 2)[pixels], np.ascontiguousarray(slopes.reshape(-1, 2)[pixels])


def _steepest(slope: NDArray[np.float64], usable: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Flat indices of steep pixels, spread evenly over all that are steep enough."""
    if not usable.any():
        return np.empty(0, dtype=np.intp)
    smallest = max(_SMALLEST_SLOPE, _STEEP * float(np.quantile(slope[usable], 0.98)))
    steep = np.flatnonzero(usable & (slope >= smallest))
    if steep.size <= _POINTS:
        return steep
    return steep[np.linspace(0, steep.size - 1, _POINTS).astype(np.intp)]
