"""Spheres seen by a camera at a finite height: exact ellipses.

Tested by ``test/simulation/plate_scene/test_optics.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import SimulationError

if TYPE_CHECKING:
    from numpy.typing import NDArray


class SeenSpheres(NamedTuple):
    """Outlines of spheres.

    Parameters
    ----------
    centres : ndarray (n, 2), [px]
    stretch : ndarray (n, 2, 2)
        Symmetric matrix from the outline without perspective to the one with it.
    """

    centres: NDArray[np.float64]
    stretch: NDArray[np.float64]


def seen_spheres(
    points: NDArray[np.float64],
    heights: NDArray[np.float64],
    radii: NDArray[np.float64],
    axis: NDArray[np.float64],
    camera_height: float,
) -> SeenSpheres:
    """Project spheres onto the plane of the floor, all lengths in pixels of that plane.

    A cone around a sphere of radius r, at the distance q from the axis and z below the camera,
    cuts the floor, H below the camera, in an ellipse with its middle at H q z / (z^2 - r^2), the
    half axis H r sqrt(q^2 + z^2 - r^2) / (z^2 - r^2) along q and H r / sqrt(z^2 - r^2) across.

    Parameters
    ----------
    points : ndarray (n, 2)
        Below the centres of the spheres.
    heights, radii : ndarray (n,)
    axis : ndarray (2,)
    camera_height : float

    Raises
    ------
    SimulationError
        For a sphere that reaches up to the camera.
    """
    below = camera_height - heights
    if not (below > radii).all():
        raise SimulationError(
            'camera_height',
            f'{camera_height:.0f} px, but beads reach {np.max(heights + radii):.0f} px',
            'raise scene.camera_height',
        )
    offset = points - axis
    square = below**2 - radii**2
    distance_squared = np.sum(offset**2, axis=1)
    centres = axis + offset * (camera_height * below / square)[:, np.newaxis]
    across = camera_height / np.sqrt(square)
    along = camera_height * np.sqrt(distance_squared + square) / square
    distance = np.sqrt(distance_squared)
    unit = np.divide(
        offset,
        distance[:, np.newaxis],
        where=distance[:, np.newaxis] > 0.0,
        out=np.zeros_like(offset),
    )
    stretch = unit[:, :, np.newaxis] * unit[:, np.newaxis, :]
    stretch = (along - across)[:, np.newaxis, np.newaxis] * stretch
    return SeenSpheres(centres, stretch + across[:, np.newaxis, np.newaxis] * np.eye(2))
