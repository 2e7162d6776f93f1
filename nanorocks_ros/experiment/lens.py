"""Lens models: from the rectified picture to the distorted one and back.

Points are in pixels from the upper left corner of the picture; the centre of the first pixel is
at (0.5, 0.5). ROS and OpenCV count from that centre, see `Camera.matrix`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Newton's iteration for the angle gains a factor of over 100 each time.
_MOST_ITERATIONS = 20
_EXACT = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera with an equidistant (fisheye) lens, as in sensor_msgs/CameraInfo.

    A point seen at the angle t from the axis appears at the distance f d(t) from the centre,
    d(t) = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8); in the rectified picture at f tan(t).
    (Kannala and Brandt 2006, IEEE PAMI 28, 1335.)

    Parameters
    ----------
    width, height : int, [px]
    focal : tuple of 2 floats, [px], > 0
        Along columns and rows.
    centre : tuple of 2 floats, [px]
        Where the axis meets the picture.
    distortion : tuple of 4 floats
        k1 to k4.

    Raises
    ------
    ConfigurationError
        For numbers that are not finite, or a distortion that is not monotonic in the picture.
    """

    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _check(self)
        angles = np.linspace(0.0, self._widest_angle(), 200)
        if (self._slope(angles) <= 0.0).any():
            raise ConfigurationError(
                'camera',
                f'the distortion {self.distortion} folds the picture over',
                'calibrate it again',
            )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The matrix K of ROS and OpenCV, (3, 3): they count from the centre of a pixel."""
        return _matrix(self)

    def distorted(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distort points of the rectified picture.

        Parameters
        ----------
        points : ndarray (..., 2), [px]

        Returns
        -------
        ndarray (..., 2), [px]
        """
        flat = (np.asarray(points, dtype=np.float64) - self.centre) / self.focal
        radius = np.hypot(flat[..., 0], flat[..., 1])
        angle = np.arctan(radius)
        ratio = np.divide(
            self._bent(angle), radius, where=radius > _EXACT, out=np.ones_like(radius)
        )
        return np.asarray(flat * ratio[..., np.newaxis] * self.focal + self.centre)

    def rectified(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Undistort points of the picture.

        Parameters
        ----------
        points : ndarray (..., 2), [px]

        Returns
        -------
        ndarray (..., 2), [px]
            NaN for angles of 90 degrees or more.
        """
        bent = (np.asarray(points, dtype=np.float64) - self.centre) / self.focal
        radius = np.hypot(bent[..., 0], bent[..., 1])
        angle = np.minimum(radius, 0.5 * math.pi)
        for _ in range(_MOST_ITERATIONS):
            step = (self._bent(angle) - radius) / np.maximum(self._slope(angle), _EXACT)
            angle = angle - step
            if not (np.abs(step) > _EXACT).any():
                break
        lost = ~((angle >= 0.0) & (angle < 0.5 * math.pi))
        ratio = np.divide(
            np.tan(np.where(lost, 0.0, angle)),
            radius,
            where=radius > _EXACT,
            out=np.ones_like(radius),
        )
        ratio[lost] = np.nan
        return np.asarray(bent * ratio[..., np.newaxis] * self.focal + self.centre)

    def _widest_angle(self) -> float:
        """Angle of the corner of the rectified picture that is furthest from the axis."""
        across = max(self.centre[0], self.width - self.centre[0]) / self.focal[0]
        down = max(self.centre[1], self.height - self.centre[1]) / self.focal[1]
        return math.atan(math.hypot(across, down))

    def _bent(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, k3, k4 = self.distortion
        square = angle * angle
        return np.asarray(
            angle * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        )

    def _slope(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, k3, k4 = self.distortion
        square = angle * angle
        return np.asarray(
            1.0
            + square * (3.0 * k1 + square * (5.0 * k2 + square * (7.0 * k3 + square * 9.0 * k4)))
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlumbBob:
    """A camera with the polynomial lens that ROS calls ``plumb_bob``.

    Parameters
    ----------
    width, height : int, [px]
    focal, centre : tuple of 2 floats, [px]
    distortion : tuple of 5 floats
        k1, k2, p1, p2, k3 (Brown 1966, Photogrammetric Engineering 32, 444).

    Raises
    ------
    ConfigurationError
        For invalid numbers.
    """

    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float, float]

    def __post_init__(self) -> None:
        _check(self)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The matrix K of ROS and OpenCV, (3, 3): they count from the centre of a pixel."""
        return _matrix(self)

    def distorted(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distort points of the undistorted picture, [px]."""
        k1, k2, p1, p2, k3 = self.distortion
        flat = (np.asarray(points, dtype=np.float64) - self.centre) / self.focal
        x, y = flat[..., 0], flat[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        bent = np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )
        return np.asarray(bent * self.focal + self.centre)


def _check(camera: Camera | PlumbBob) -> None:
    numbers = (*camera.focal, *camera.centre, *camera.distortion)
    if not all(math.isfinite(value) for value in numbers) or min(camera.focal) <= 0.0:
        raise ConfigurationError(
            'camera', f'numbers {numbers}', 'give finite ones, and positive focal lengths'
        )
    if camera.width < 1 or camera.height < 1:
        raise ConfigurationError(
            'camera', f'a picture of {camera.width} x {camera.height} px', 'give its size'
        )


def _matrix(camera: Camera | PlumbBob) -> NDArray[np.float64]:
    return np.array(
        [
            [camera.focal[0], 0.0, camera.centre[0] - 0.5],
            [0.0, camera.focal[1], camera.centre[1] - 0.5],
            [0.0, 0.0, 1.0],
        ]
    )
