"""Lens and pose of the plate from the edges of the trays: least squares, no checkerboard.

The sides of the floors are straight and their sizes known, their places nearly: what bends them
in the picture is the lens, what makes one scale differ from another is the pose of the plate.
One plane picture tells only one function of the distance from the axis, so the focal length is
what explains it best with an ideal equidistant lens, and the coefficients k1 and k2 take the rest.
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

# Places in the vector of unknowns.
_BEND, _CENTRE, _K, _TURN, _SCALE, _PLACE = (
    0,
    slice(1, 3),
    slice(3, 5),
    slice(5, 8),
    8,
    slice(9, 11),
)
# Width of the wall as seen from above: the edge that is seen best may be its outer one.
_WALL = 11
_COMMON = 12
_WALL_USUAL, _WALL_ERROR = 0.5e-3, 0.1e-3
# How well things are known before: place and size of a floor [m], axis of the lens as a share of
# the width, k1 and k2, and tilt of the plate.
_TOLERANCE = 0.04e-3
_CENTRE_SHARE = 0.03
_K_USUAL = 0.3
_TILT_USUAL = math.radians(3.0)
# Of one place on an edge, [px].
_EDGE_ERROR = 0.15
_NO_WALL = 0.01e-3
_LONGEST_FOCAL = 20.0
# Below this bend, 1 / (f / width)^2, a lens is no fisheye; and the coefficients with which an
# equidistant one bends nothing, the series of the tangent.
_STRAIGHT = 0.02
_TANGENT = np.array([1.0 / 3.0, 2.0 / 15.0])
_OUTWARDS = np.array([-1.0, -1.0, 2.0, 2.0])
# How far from where they should be edges are looked for: at first in metres, less than half of
# what lies between two trays, and once the walls are told from the floors in pixels.
_FIRST_REACHES = (1.9e-3, 1.1e-3)
_REACHES = (9.0, 8.0, 6.0, 6.0)


@dataclass(frozen=True, slots=True)
class PlateFit:
    """The calibration, and how well it fits.

    Parameters
    ----------
    calibration : Calibration
    edges : Edges
        That were used.
    residuals : ndarray, (n,), [px]
        Distance of each from where it should be.
    tray_scales : dict of int to float, [px/m]
        In the picture of the camera, in the middle of each tray.
    """

    calibration: Calibration
    edges: Edges
    residuals: NDArray[np.float64]
    tray_scales: dict[int, float]


class PlateModel:
    """From the floors of the trays to the picture of the camera.

    Parameters
    ----------
    trays : sequence of Tray
    size : tuple of 2 ints, [px]
        Width and height of the picture.
    guess : PlateGuess
    """

    def __init__(self, trays: Sequence[Tray], size: tuple[int, int], guess: PlateGuess) -> None:
        self.trays = trays
        self.size = size
        self._order = {tray.number: k for k, tray in enumerate(trays)}
        self._boxes = np.array(list(plate_places(trays).values()))
        self.values = np.zeros(_COMMON + 4 * len(trays))
        middle = 0.5 * np.array(size)
        self._usual_k = np.zeros(2)
        # 1 / (f / width) squared: no lens at all is 0, and not infinitely far away.
        self.values[_BEND] = 0.1
        self.values[_CENTRE] = middle
        self.values[_SCALE] = guess.pixels_per_metre
        half = 0.04 * guess.pixels_per_metre
        self.values[_PLACE] = np.array(guess.corner) + half - middle

    @property
    def focal(self) -> float:
        """Focal length, [px]."""
        return self._focal(self.values)

    def _focal(self, values: NDArray[np.float64]) -> float:
        return self.size[0] / math.sqrt(max(values[_BEND], 1.0 / _LONGEST_FOCAL**2))

    def floor(self, number: int, values: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """x, y, width, height of a floor from the middle of the plate, as fitted, [m]."""
        values = self.values if values is None else values
        k = self._order[number]
        found: NDArray[np.float64] = (
            self._boxes[k] + values[_COMMON + 4 * k : _COMMON + 4 * k + 4] * _TOLERANCE
        )
        return found

    def picture(self, places: NDArray[np.float64], number: int) -> NDArray[np.float64]:
        """Where places within the edge of a tray, as shares, are in the picture, [px]."""
        box = self.floor(number) + self.values[_WALL] * _OUTWARDS
        return self._project(self.values, box[:2] + places * box[2:])

    def _project(
        self, values: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Points of the plate [m] in the picture [px]."""
        focal = self._focal(values)
        turn = cv2.Rodrigues(values[_TURN])[0]
        space = points @ turn[:, :2].T * (values[_SCALE] / focal)
        flat = (space[..., :2] + values[_PLACE] / focal) / (1.0 + space[..., 2:])
        radius = np.hypot(flat[..., 0], flat[..., 1])
        angle = np.arctan(radius)
        square = angle * angle
        k1, k2 = values[_K]
        bent = angle * (1.0 + square * (k1 + square * k2))
        ratio = np.divide(bent, radius, where=radius > 1e-12, out=np.ones_like(radius))
        return np.asarray(flat * (ratio * focal)[..., np.newaxis] + values[_CENTRE])

    def residuals(self, values: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
        """Distance of each edge from where it should be, [px]."""
        order = np.array([self._order[tray] for tray in edges.trays])
        boxes = self._boxes + values[_COMMON:].reshape(-1, 4) * _TOLERANCE
        boxes = boxes + values[_WALL] * _OUTWARDS
        own = boxes[order]
        points = self._project(values, own[:, :2] + edges.places * own[:, 2:])
        return np.asarray(((edges.found - points) * edges.normals).sum(axis=1))

    def fit(self, edges: Edges, free_lens: bool) -> None:
        """Adjust to the edges; the coefficients of the lens too, or its focal length alone."""
        if free_lens and self.values[_BEND] < _STRAIGHT:
            # Not a fisheye: a lens that bends nothing, so that it may bend the other way too.
            self.values[_BEND], self._usual_k = 0.25, _TANGENT
            self.values[_K] = _TANGENT
        free = np.ones(self.values.size, dtype=bool)
        free[_K if not free_lens else _BEND] = False
        start = self.values[free]
        scale = np.ones(self.values.size)
        scale[_CENTRE] = scale[_PLACE] = 10.0
        scale[_SCALE] = 0.01 * self.values[_SCALE]
        scale[_WALL] = 1e-4
        scale[_TURN], scale[_K], scale[_BEND] = 0.01, 0.05, 0.05
        middle = 0.5 * np.array(self.size)
        # Until the walls are told from the floors the fit has to find out how wide they are.
        told = math.isfinite(edges.wall_px)
        wall = edges.wall_px / float(self.values[_SCALE]) if told else 0.0
        wall_error = _WALL_ERROR if told and wall > 0.0 else _NO_WALL if told else _WALL_USUAL

        def every(part: NDArray[np.float64]) -> NDArray[np.float64]:
            values = self.values.copy()
            values[free] = part
            distances = self.residuals(values, edges) / _EDGE_ERROR
            # Far-off edges pull with a bounded force (soft l1); what is known before as it is.
            bounded = np.sign(distances) * np.sqrt(2.0 * (np.sqrt(1.0 + distances**2) - 1.0))
            known = [
                (values[_CENTRE] - middle) / (_CENTRE_SHARE * self.size[0]),
                (values[_K] - self._usual_k) / _K_USUAL,
                values[_TURN][:2] / _TILT_USUAL,
                (values[_WALL : _WALL + 1] - wall) / wall_error,
                values[_COMMON:],
            ]
            return np.concatenate([bounded, *known])

        found = least_squares(every, start, x_scale=scale[free], max_nfev=60)
        self.values[free] = found.x


def fit_plate(
    gray: NDArray[np.float32], trays: Sequence[Tray], guess: PlateGuess
) -> PlateFit | None:
    """Lens, pose and regions from one picture; None when too few edges are seen.

    Parameters
    ----------
    gray : ndarray of float32, (rows, columns)
        The scene without what moves in it.
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
    """Square root of the area of the floor in the picture over that of the floor."""
    corners = np.array([[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]])
    x, y = model.picture(corners, tray.number).T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    width, height = model.floor(tray.number)[2:]
    return float(math.sqrt(area / (0.04 * width * height)))


def _calibration(model: PlateModel, residual: float) -> Calibration:
    """The fit in the words of camera_info: the view from straight above, at the same scale."""
    values, focal, (width, height) = model.values, model.focal, model.size
    scale = float(values[_SCALE])
    turn = cv2.Rodrigues(values[_TURN])[0]
    away = turn.T @ np.array([*(values[_PLACE] / focal), 1.0]) * (focal / scale)
    new_focal = scale * away[2]
    middle = 0.5 * np.array([width, height]) - scale * away[:2]
    cx, cy = (float(one) - 0.5 for one in values[_CENTRE])
    k1, k2 = (float(one) for one in values[_K])
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
        r=tuple(float(one) for one in turn.T.ravel()),
        p=tuple(float(one) for one in p),
    )
    regions = {}
    for tray in model.trays:
        box = model.floor(tray.number) * scale
        corner = box[:2] + 0.5 * np.array([width, height])
        end = corner + box[2:]
        x, y = (round(float(one)) for one in corner)
        regions[tray.number] = Region(x, y, round(float(end[0])) - x, round(float(end[1])) - y)
    return Calibration(
        view=rectified_view(info, 'calibration'),
        pixels_per_metre=scale,
        regions=regions,
        residual_px=residual,
        info=info,
    )
