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
_STEEPEST = 0.98
# What is so many times as steep as the walls, with the pixels around it, is laid over the picture;
# length of wall of which the steepest slope is taken.
_LAID_OVER, _AROUND_PX, _CELL_PX = 3.0, 9, 16
# Parts of each wall, whose motions are compared, and fewest points of a part; number of the first
# pictures, with whose mean they are compared, and pictures between two comparisons.
_PARTS, _FEWEST_IN_PART = 6, 5
_FIRST_PICTURES, _EVERY = 64, 16
# Distance by which two opposite walls move apart, or together, in so many comparisons: the camera
# zooms. Without one, walls of three of 80 drawn films seemed to by 0.6 to 0.9 px.
_GROWN_PX, _GROWN_TIMES, _FEWEST_OF_WALL = 1.0, 4, 3
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

    Attributes
    ----------
    grows : bool
        Whether the tray has grown or shrunk in the picture.
    """

    def __init__(
        self, region: Region, view: View, wall_px: float, mix: NDArray[np.float64]
    ) -> None:
        self._region = region
        self._view = view
        self._wall = max(4, math.ceil(wall_px))
        self._mix = mix
        self._places: NDArray[np.float64] | None = None
        self._slopes = self._first = self._reference = self._values = np.empty(0)
        self._trust = self._powers = np.empty(0)
        self._parts = np.empty(0, dtype=np.intp)
        self._seen, self._pictures, self._grown = 0, 0, 0
        self.grows = False
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
        self._pictures += 1
        if self._pictures == _FIRST_PICTURES:
            self._first = self._reference.copy()
        if self._first.size and self._pictures % _EVERY == 0:
            self._compare_sizes()
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

    def _compare_sizes(self) -> None:
        """Whether opposite walls have moved apart since the first pictures."""
        # The light may have changed.
        light = np.polyfit(self._first, self._values, 1)
        differences = self._values - np.polyval(light, self._first)
        grown = max(abs(_apart(self._moved_parts(axis, differences))) for axis in (0, 1))
        self._grown = self._grown + 1 if grown > _GROWN_PX else 0
        self.grows = self.grows or self._grown >= _GROWN_TIMES

    def _moved_parts(self, axis: int, differences: NDArray[np.float64]) -> NDArray[np.float64]:
        """By how much parts of the two walls across an axis have moved, [px]; NaN for few points.

        Parameters
        ----------
        axis : int
        differences : ndarray (n,), [gray levels]
            From an earlier picture.
        """
        slopes = self._slopes[:, axis]
        seen = np.abs(slopes) > _SMALLEST_SLOPE
        parts, own = self._parts[seen], slopes[seen]
        count = 4 * _PARTS
        weights = np.maximum(np.bincount(parts, own * own, minlength=count), 1.0)
        moved = np.bincount(parts, -own * differences[seen], minlength=count) / weights
        few = np.bincount(parts, minlength=count) < _FEWEST_IN_PART
        return np.where(few, np.nan, moved)[2 * _PARTS * axis :][: 2 * _PARTS]

    def _choose_points(self, image: NDArray[np.uint8]) -> Shift | None:
        """Choose the points to register; None when the walls have too few edges."""
        points, slopes = self._edges(image)
        self._places = places_of(points, self._view)
        self._slopes = slopes
        self._reference = np.empty(len(points))
        self._values = np.empty(len(points))
        self._powers, self._trust = np.ones(len(points)), np.ones(len(points))
        self._parts = self._parts_of(points)
        if not len(points):
            return None
        sample(image, self._mix, self._places, (0.0, 0.0), self._reference)
        self._seen = 1
        return self._registered(image, (0.0, 0.0))

    def _parts_of(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """Number of the part of the walls in which each point lies."""
        region = self._region
        x, y = (points - (region.x, region.y)).T / np.array([[region.width], [region.height]])
        along = np.where((x < 0.0) | (x > 1.0), y, x)
        # Left, right, above and below: each axis has two walls across it.
        side = np.select([x < 0.0, x > 1.0, y < 0.0], [0, 1, 2], 3)
        parts: NDArray[np.intp] = _PARTS * side + np.clip(_PARTS * along, 0, _PARTS - 1).astype(
            int
        )
        return parts

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
        across, down = np.abs(np.moveaxis(steepness, -1, 0))
        usable &= ~_is_laid_over(across, usable, inner) & ~_is_laid_over(down.T, usable.T, inner).T
        chosen = [_steepest(slope, usable) for slope in (across, down)]
        if min(len(points) for points in chosen) < _FEWEST_POINTS:
            return np.empty((0, 2)), np.empty((0, 2))
        pixels = np.unique(np.concatenate(chosen))
        return grid.reshape(-1, 2)[pixels], np.ascontiguousarray(slopes.reshape(-1, 2)[pixels])


def _apart(moved: NDArray[np.float64]) -> float:
    """By how much the parts of two opposite walls have moved apart, [px]; 0 if not known."""
    before, behind = (wall[np.isfinite(wall)].tolist() for wall in np.split(moved, 2))
    if min(len(before), len(behind)) < _FEWEST_OF_WALL:
        return 0.0
    return median(behind) - median(before)


def _is_laid_over(
    slope: NDArray[np.float64], usable: NDArray[np.bool_], side: int
) -> NDArray[np.bool_]:
    """What has far steeper slopes along the rows than the walls at both ends of them.

    Such as a clock or a name that a recorder writes into the picture, which does not move with
    the tray.

    Parameters
    ----------
    slope : ndarray, (rows, columns), [gray levels/px]
    usable : ndarray of bool, (rows, columns)
    side : int, [px]
        Width of a wall.
    """
    usual = 0.0
    for wall in (slice(0, side), slice(slope.shape[1] - side, None)):
        cells = [
            np.quantile(seen, _STEEPEST)
            for row in range(0, slope.shape[0], _CELL_PX)
            if (seen := slope[row : row + _CELL_PX, wall][usable[row : row + _CELL_PX, wall]]).size
        ]
        usual = max(usual, median(cells) if cells else 0.0)
    steep = (usable & (slope > _LAID_OVER * max(usual, _SMALLEST_SLOPE))).astype(np.uint8)
    return cv2.dilate(steep, np.ones((_AROUND_PX, _AROUND_PX), dtype=np.uint8)) > 0


def _steepest(slope: NDArray[np.float64], usable: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Flat indices of steep pixels, spread evenly over all that are steep enough."""
    if not usable.any():
        return np.empty(0, dtype=np.intp)
    smallest = max(_SMALLEST_SLOPE, _STEEP * float(np.quantile(slope[usable], _STEEPEST)))
    steep = np.flatnonzero(usable & (slope >= smallest))
    if steep.size <= _POINTS:
        return steep
    return steep[np.linspace(0, steep.size - 1, _POINTS).astype(np.intp)]
