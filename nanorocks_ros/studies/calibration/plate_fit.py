"""Lens and pose of the plate by least squares from the edges of the trays, without a checkerboard.

The sides of the floors are straight, of known size and approximately known position. The lens
bends them in the image; the pose of the plate varies their scale. One image of a plane determines
only one function of the distance from the axis: the focal length is that of the equidistant lens
that fits best, and the coefficients k1 and k2 describe the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import least_squares

from nanorocks_ros.experiment.calibration import Calibration, CameraInfo, rectified_view
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.stages.preprocess.plate_search import PlateGuess, plate_places
from nanorocks_ros.stages.preprocess.tray_edges import find_edges

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.stages.preprocess.tray_edges import Edges

# Indices of the vector of unknowns.
_INVERSE_FOCAL_SQUARED, _CENTRE, _K, _ROTATION, _SCALE, _OFFSET = (
    0,
    slice(1, 3),
    slice(3, 5),
    slice(5, 8),
    8,
    slice(9, 11),
)
# Index of the width of the wall from above: the clearest edge may be the outer one of the wall.
_WALL = 11
_N_COMMON = 12
_UNKNOWN_WALL_ERROR, _WALL_ERROR = 0.5e-3, 0.1e-3
# Prior standard deviations: position and size of a floor [m], axis of the lens relative to the
# width of the image, k1 and k2, tilt of the plate.
_FLOOR_ERROR = 0.04e-3
_CENTRE_ERROR = 0.03
_K_ERROR = 0.3
_TILT_ERROR = math.radians(3.0)
# Standard error of a point on an edge, [px].
_EDGE_ERROR = 0.15
_NO_WALL_ERROR = 0.01e-3
_MAX_FOCAL = 20.0
# Below this value of 1 / (f / width)^2 a lens is not a fisheye; and the coefficients that make an
# equidistant lens rectilinear, from the series of the tangent.
_RECTILINEAR = 0.02
_TANGENT = np.array([1.0 / 3.0, 2.0 / 15.0])
_OUTWARDS = np.array([-1.0, -1.0, 2.0, 2.0])
# Search range for edges about their expected position: at first in metres, less than half of the
# distance between two trays; then, with walls and floors distinguished, in pixels.
_FIRST_REACHES = (1.9e-3, 1.1e-3)
_REACHES = (9.0, 8.0, 6.0, 6.0)


@dataclass(frozen=True, slots=True)
class PlateFit:
    """A calibration with the residuals of its fit.

    Parameters
    ----------
    calibration : Calibration
    edges : Edges
        Edges that were fitted.
    residuals : ndarray, (n,), [px]
        Distance of each edge from its fitted position.
    tray_scales : dict of int to float, [px/m]
        Scale of the camera image in the middle of each tray.
    """

    calibration: Calibration
    edges: Edges
    residuals: NDArray[np.float64]
    tray_scales: dict[int, float]


class PlateModel:
    """Projection of the floors of the trays to the camera image.

    Parameters
    ----------
    trays : sequence of Tray
    size : tuple of 2 ints, [px]
        Width and height of the image.
    guess : PlateGuess
    """

    def __init__(self, trays: Sequence[Tray], size: tuple[int, int], guess: PlateGuess) -> None:
        self.trays = trays
        self.size = size
        self._order = {tray.number: k for k, tray in enumerate(trays)}
        self._boxes = np.array(list(plate_places(trays).values()))
        self.values = np.zeros(_N_COMMON + 4 * len(trays))
        middle = 0.5 * np.array(size)
        self._usual_k = np.zeros(2)
        # 1 / (f / width)^2: 0 for parallel projection, so that it is not at infinity.
        self.values[_INVERSE_FOCAL_SQUARED] = 0.1
        self.values[_CENTRE] = middle
        self.values[_SCALE] = guess.pixels_per_metre
        half = 0.04 * guess.pixels_per_metre
        self.values[_OFFSET] = np.array(guess.corner) + half - middle

    @property
    def focal(self) -> float:
        """Focal length, [px]."""
        return self._focal(self.values)

    def _focal(self, values: NDArray[np.float64]) -> float:
        return self.size[0] / math.sqrt(max(values[_INVERSE_FOCAL_SQUARED], 1.0 / _MAX_FOCAL**2))

    def floor(self, number: int, values: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Fitted x, y, width and height of a floor, from the middle of the plate, [m]."""
        values = self.values if values is None else values
        k = self._order[number]
        box: NDArray[np.float64] = (
            self._boxes[k] + values[_N_COMMON + 4 * k : _N_COMMON + 4 * k + 4] * _FLOOR_ERROR
        )
        return box

    def picture(self, points: NDArray[np.float64], number: int) -> NDArray[np.float64]:
        """Image positions of points of a tray, given relative to its box, [px]."""
        box = self.floor(number) + self.values[_WALL] * _OUTWARDS
        return self._project(self.values, box[:2] + points * box[2:])

    def _project(
        self, values: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Points of the plate [m] in the picture [px]."""
        focal = self._focal(values)
        rotation = cv2.Rodrigues(values[_ROTATION])[0]
        rotated = points @ rotation[:, :2].T * (values[_SCALE] / focal)
        projected = (rotated[..., :2] + values[_OFFSET] / focal) / (1.0 + rotated[..., 2:])
        radius = np.hypot(projected[..., 0], projected[..., 1])
        angle = np.arctan(radius)
        square = angle * angle
        k1, k2 = values[_K]
        distorted = angle * (1.0 + square * (k1 + square * k2))
        ratio = np.divide(distorted, radius, where=radius > 1e-12, out=np.ones_like(radius))
        return np.asarray(projected * (ratio * focal)[..., np.newaxis] + values[_CENTRE])

    def residuals(self, values: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
        """Distance of each edge from its modelled position, [px]."""
        order = np.array([self._order[tray] for tray in edges.trays])
        boxes = self._boxes + values[_N_COMMON:].reshape(-1, 4) * _FLOOR_ERROR
        boxes = boxes + values[_WALL] * _OUTWARDS
        tray_boxes = boxes[order]
        points = self._project(values, tray_boxes[:, :2] + edges.places * tray_boxes[:, 2:])
        return np.asarray(((edges.found - points) * edges.normals).sum(axis=1))

    def fit(self, edges: Edges, free_lens: bool) -> None:
        """Fit the edges, with the coefficients of the lens or its focal length alone."""
        if free_lens and self.values[_INVERSE_FOCAL_SQUARED] < _RECTILINEAR:
            # Not a fisheye: start from a rectilinear lens, which can distort either way.
            self.values[_INVERSE_FOCAL_SQUARED], self._usual_k = 0.25, _TANGENT
            self.values[_K] = _TANGENT
        free = np.ones(self.values.size, dtype=bool)
        free[_K if not free_lens else _INVERSE_FOCAL_SQUARED] = False
        start = self.values[free]
        scale = np.ones(self.values.size)
        scale[_CENTRE] = scale[_OFFSET] = 10.0
        scale[_SCALE] = 0.01 * self.values[_SCALE]
        scale[_WALL] = 1e-4
        scale[_ROTATION], scale[_K], scale[_INVERSE_FOCAL_SQUARED] = 0.01, 0.05, 0.05
        middle = 0.5 * np.array(self.size)
        # Until walls and floors are distinguished, the width of the wall is fitted freely.
        walls_found = math.isfinite(edges.wall_px)
        wall = edges.wall_px / float(self.values[_SCALE]) if walls_found else 0.0
        wall_error = (
            _WALL_ERROR
            if walls_found and wall > 0.0
            else _NO_WALL_ERROR
            if walls_found
            else _UNKNOWN_WALL_ERROR
        )

        def weighted_residuals(free_values: NDArray[np.float64]) -> NDArray[np.float64]:
            values = self.values.copy()
            values[free] = free_values
            distances = self.residuals(values, edges) / _EDGE_ERROR
            # The influence of outliers among edges is bounded (soft l1), that of the priors not.
            bounded = np.sign(distances) * np.sqrt(2.0 * (np.sqrt(1.0 + distances**2) - 1.0))
            prior_residuals = [
                (values[_CENTRE] - middle) / (_CENTRE_ERROR * self.size[0]),
                (values[_K] - self._usual_k) / _K_ERROR,
                values[_ROTATION][:2] / _TILT_ERROR,
                (values[_WALL : _WALL + 1] - wall) / wall_error,
                values[_N_COMMON:],
            ]
            return np.concatenate([bounded, *prior_residuals])

        solution = least_squares(weighted_residuals, start, x_scale=scale[free], max_nfev=60)
        self.values[free] = solution.x


def fit_plate(
    gray: NDArray[np.float32], trays: Sequence[Tray], guess: PlateGuess
) -> PlateFit | None:
    """Fit lens, pose and regions to one image; None when too few edges are found.

    Parameters
    ----------
    gray : ndarray of float32, (rows, columns)
        The scene without moving beads.
    trays : sequence of Tray
    guess : PlateGuess
    """
    size = (gray.shape[1], gray.shape[0])
    model = PlateModel(trays, size, guess)
    scale = guess.pixels_per_metre
    rounds = [(reach * scale, False, False) for reach in _FIRST_REACHES]
    rounds += [(reach, True, number > 0) for number, reach in enumerate(_REACHES)]
    edges = None
    for reach, walls, free_lens in rounds:
        scale = float(model.values[_SCALE])
        edges = find_edges(gray, trays, model.picture, scale, reach, walls=walls)
        if len(edges.trays) < 4 * model.values.size:
            return None
        model.fit(edges, free_lens=free_lens)
    assert edges is not None
    residuals = model.residuals(model.values, edges)
    return PlateFit(
        calibration=_calibration(model, float(np.sqrt(np.mean(residuals**2)))),
        edges=edges,
        residuals=residuals,
        tray_scales={tray.number: _local_scale(model, tray) for tray in trays},
    )


def _local_scale(model: PlateModel, tray: Tray) -> float:
    """Scale of a floor: the square root of its image area over its area, [px/m]."""
    corners = np.array([[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]])
    x, y = model.picture(corners, tray.number).T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    width, height = model.floor(tray.number)[2:]
    return float(math.sqrt(area / (0.04 * width * height)))


def _calibration(model: PlateModel, residual: float) -> Calibration:
    """The fit as camera_info: the rectified view is from straight above, at the same scale."""
    values, focal, (width, height) = model.values, model.focal, model.size
    scale = float(values[_SCALE])
    rotation = cv2.Rodrigues(values[_ROTATION])[0]
    centre_ray = rotation.T @ np.array([*(values[_OFFSET] / focal), 1.0]) * (focal / scale)
    new_focal = scale * centre_ray[2]
    middle = 0.5 * np.array([width, height]) - scale * centre_ray[:2]
    cx, cy = (float(value) - 0.5 for value in values[_CENTRE])
    k1, k2 = (float(value) for value in values[_K])
    p = (
        new_focal,
        0.0,
        middle[0] - 0.5,
        0.0,
        0.0,
        new_focal,
        middle[1] - 0.5,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
    )
    info = CameraInfo(
        width=width,
        height=height,
        distortion_model='equidistant',
        d=(k1, k2, 0.0, 0.0),
        k=(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0),
        r=tuple(float(value) for value in rotation.T.ravel()),
        p=tuple(float(value) for value in p),
    )
    regions = {}
    for tray in model.trays:
        box = model.floor(tray.number) * scale
        corner = box[:2] + 0.5 * np.array([width, height])
        end = corner + box[2:]
        x, y = (round(float(value)) for value in corner)
        regions[tray.number] = Region(x, y, round(float(end[0])) - x, round(float(end[1])) - y)
    return Calibration(
        view=rectified_view(info, 'calibration'),
        pixels_per_metre=scale,
        regions=regions,
        residual_px=residual,
        info=info,
    )
