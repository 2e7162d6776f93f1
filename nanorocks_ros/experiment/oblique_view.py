"""A container that the camera sees at an angle: four corners that form no upright rectangle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import CameraInfo
from nanorocks_ros.experiment.view import IDENTITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

MAX_STRETCH = 1.4
"""Largest ratio of two scales in the picture, of any places and directions, that is rectified."""


class Perspective(NamedTuple):
    """The corners of a rectangle in a film, and its rectified picture.

    Parameters
    ----------
    corners_px : tuple of four (float, float), [px]
        Column and row of each in the film, from the corner of the picture; clockwise, the one
        nearest to the upper left first. A line from the first to the second is a row of the
        rectified picture.
    size_px : tuple of 2 ints, [px]
        Width and height of the rectified picture.
    """

    corners_px: tuple[tuple[float, float], ...]
    size_px: tuple[int, int]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Homography from the rectified picture to the film, (3, 3); both from their corners."""
        width, height = self.size_px
        rectified = np.array([(0, 0), (width, 0), (width, height), (0, height)], dtype=np.float32)
        corners = np.array(self.corners_px, dtype=np.float32)
        return np.asarray(cv2.getPerspectiveTransform(rectified, corners), dtype=np.float64)

    @property
    def stretch(self) -> float:
        """Ratio of the largest to the smallest scale, of all places and directions."""
        sizes = [np.linalg.svd(self._slopes(corner))[1] for corner in self._ends()]
        return float(np.max(sizes) / np.min(sizes))

    def film_discs(self, discs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Discs (n, 3) of the rectified picture in the film: column, row, mean radius, [px]."""
        if len(discs) == 0:
            return discs
        points = np.column_stack([discs[:, :2], np.ones(len(discs))]) @ self.matrix.T
        scales = [math.sqrt(abs(np.linalg.det(self._slopes(place)))) for place in discs[:, :2]]
        return np.column_stack([points[:, :2] / points[:, 2:], discs[:, 2] * np.array(scales)])

    def rectified(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The rectified picture of a frame."""
        # Pixels have their places in their middle.
        middle = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
        matrix = np.linalg.inv(middle) @ self.matrix @ middle
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(image, matrix, self.size_px, flags=flags))

    def camera_info(self, picture_px: tuple[int, int]) -> CameraInfo:
        """A camera without distortion whose rectified picture this is.

        Parameters
        ----------
        picture_px : tuple of 2 ints, [px]
            Width and height of the film.
        """
        width, height = picture_px
        focal = float(max(picture_px))
        camera = np.array([[focal, 0.0, 0.5 * width], [0.0, focal, 0.5 * height], [0.0, 0.0, 1.0]])
        corner = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
        # The camera is not turned: the projection alone says how it is tilted.
        projection = np.linalg.inv(corner) @ np.linalg.inv(self.matrix) @ corner @ camera
        projection /= projection[2, 2]
        return CameraInfo(
            width=width,
            height=height,
            distortion_model='plumb_bob',
            d=(0.0,) * 5,
            k=tuple(camera.ravel().tolist()),
            r=IDENTITY,
            p=tuple(np.column_stack([projection, np.zeros(3)]).ravel().tolist()),
        )

    def _ends(self) -> list[tuple[float, float]]:
        width, height = self.size_px
        return [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]

    def _slopes(self, place: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivative of the place in the film by that in the rectified picture, (2, 2)."""
        matrix = self.matrix
        x, y, w = matrix @ np.array([place[0], place[1], 1.0])
        return np.asarray((matrix[:2, :2] - np.outer([x / w, y / w], matrix[2, :2])) / w)


def clockwise(corners: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Four corners clockwise in the picture, the one nearest to the upper left first.

    Raises
    ------
    ConfigurationError
        When they are not those of a quadrangle without notches.
    """
    points = np.array(corners, dtype=np.float64)
    away = points - points.mean(axis=0)
    points = points[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    points = np.roll(points, -int(np.argmin(points.sum(axis=1))), axis=0)
    sides = np.roll(points, -1, axis=0) - points
    following = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * following[:, 1] - sides[:, 1] * following[:, 0]
    lengths = np.hypot(*sides.T)
    if not (turns > 0.1 * lengths * np.roll(lengths, -1)).all():
        raise ConfigurationError(
            '--corners', 'do not form a container', 'give its four corners, in px of the film'
        )
    return tuple((float(x), float(y)) for x, y in points)
