"""The rectified view: the plate seen from straight above, and its map to the camera picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
# Tolerance of the orthogonality of a rotation matrix in a file.
_ROUNDING = 1e-3


class Lens(Protocol):
    """Interface of a lens for a view; pixel coordinates as in `Camera`."""

    @property
    def width(self) -> int:
        """Size of the picture, [px]."""

    @property
    def height(self) -> int:
        """Size of the picture, [px]."""

    @property
    def matrix(self) -> NDArray[np.float64]:
        """K of ROS, (3, 3)."""

    def distorted(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distort points of the undistorted picture, [px]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentityLens:
    """A lens without distortion, or an unknown lens.

    Parameters
    ----------
    width, height : int, [px]
    """

    width: int
    height: int

    @property
    def matrix(self) -> NDArray[np.float64]:
        """A matrix that leaves pixels where they are."""
        return np.eye(3)

    def distorted(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The points themselves."""
        return np.asarray(points, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A camera and the homography of its rectified picture.

    Straight lines are straight in that picture, and where the camera looks at the plate at an
    angle it is the picture of a camera that does not: one scale holds everywhere on the plate.

    Parameters
    ----------
    camera : Lens
    homography : tuple of 9 floats, row by row
        From points of the rectified picture to points of the camera's straight picture (both
        counted from the corner of the picture).

    Raises
    ------
    ConfigurationError
        For a matrix that is not finite or maps the picture onto a line.
    """

    camera: Lens
    homography: tuple[float, ...] = IDENTITY

    def __post_init__(self) -> None:
        matrix = np.array(self.homography, dtype=np.float64)
        usable = matrix.shape == (9,) and np.isfinite(matrix).all()
        if not usable or abs(np.linalg.det(matrix.reshape(3, 3))) < 1e-9:
            raise ConfigurationError(
                'camera_info', f'a view of {self.homography}', 'calibrate it again'
            )

    def source(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points of the rectified picture to the camera picture.

        Parameters
        ----------
        points : ndarray (..., 2), [px]

        Returns
        -------
        ndarray (..., 2), [px]
        """
        points = np.asarray(points, dtype=np.float64)
        if self.homography == IDENTITY:
            return self.camera.distorted(points)
        matrix = np.array(self.homography, dtype=np.float64).reshape(3, 3)
        spread = points @ matrix[:, :2].T + matrix[:, 2]
        return self.camera.distorted(spread[..., :2] / spread[..., 2:])


def view_from_matrices(
    camera: Lens,
    rotation: Sequence[float],
    projection: Sequence[float],
    place: str,
) -> View:
    """The view that R and P of a sensor_msgs/CameraInfo describe.

    Parameters
    ----------
    camera : Lens
    rotation : 9 floats, row by row
        From the frame of the camera to that of the rectified picture.
    projection : 12 floats, row by row, [px]
        P of ROS, which counts from the centre of a pixel; its last column is ignored.
    where : str
        For errors.

    Raises
    ------
    ConfigurationError
        For a matrix that is no rotation, or a projection without focal lengths.
    """
    turn = np.array(rotation, dtype=np.float64).reshape(3, 3)
    project = np.array(projection, dtype=np.float64).reshape(3, 4)[:, :3]
    if not np.abs(turn @ turn.T - np.eye(3)).max() < _ROUNDING:
        raise ConfigurationError(place, 'r is no rotation', 'calibrate the camera again')
    if not (np.isfinite(project).all() and min(project[0, 0], project[1, 1]) > 0.0):
        raise ConfigurationError(place, 'p has no focal lengths', 'calibrate the camera again')
    matrix = _CORNER @ camera.matrix @ turn.T @ np.linalg.inv(_CORNER @ project)
    matrix = matrix / matrix[2, 2]
    if np.abs(matrix - np.eye(3)).max() < 1e-12:
        return View(camera=camera)
    return View(camera=camera, homography=tuple(float(value) for value in matrix.ravel()))


# From the centre of the first pixel, where ROS counts from, to its corner.
_CORNER = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
