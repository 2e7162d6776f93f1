"""Rectified crop of one tray from a frame, in colour and as gray mix.

The source position of a pixel is computed at every eighth pixel only, as the lens distorts little;
each pixel is interpolated once, directly from the frame: lens, pose of the plate and motion of the
tray in one step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.preprocess.crop_interpolation import (
    STEP,
    fill_by_pixels,
    fill_by_runs,
    fill_gray,
    inside,
    mix_levels,
    moved,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.view import View

# Step of the numerical derivative of the view, [px].
_PROBE = 0.5


@compiled
def resample_color(
    image: NDArray[np.uint8],
    nodes: NDArray[np.float64],
    shift: tuple[float, float],
    mix: NDArray[np.int64],
    color: NDArray[np.uint8],
    gray: NDArray[np.uint8],
) -> None:
    """Fill a straight crop and its gray mix by bilinear interpolation.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, 3)
        In one piece.
    nodes : ndarray, (n, m, 6)
        Of :func:`nodes_of`.
    shift : tuple of 2 floats, [px]
        Added to the places of the crop in the rectified picture.
    mix : ndarray of int64, (3,)
        Weights of the channels in the gray mix, of 65536.
    color : ndarray of uint8, (rows, columns, 3)
        Written, in the order of the channels of the picture.
    gray : ndarray of uint8, (rows, columns)
        Written.
    """
    rows, columns = gray.shape
    places_x = moved(nodes, shift, 0, image.shape[1])
    places_y = moved(nodes, shift, 1, image.shape[0])
    used = (rows - 1) // STEP + 2, (columns - 1) // STEP + 2
    whole = inside(places_x[: used[0], : used[1]], image.shape[1])
    whole &= inside(places_y[: used[0], : used[1]], image.shape[0])
    # Runs are written whole, from any of their pixels on: into the next row, but not further.
    split = rows - 1 if whole and columns >= 2 * STEP else 0
    fill_by_runs(image, places_x, places_y, split, color)
    fill_by_pixels(image, places_x, places_y, split, color)
    mix_levels(color, mix, gray)


@compiled
def resample_gray(
    image: NDArray[np.uint8],
    nodes: NDArray[np.float64],
    shift: tuple[float, float],
    gray: NDArray[np.uint8],
) -> None:
    """Fill a rectified gray crop from a gray picture, (height, width)."""
    places_x = moved(nodes, shift, 0, image.shape[1])
    places_y = moved(nodes, shift, 1, image.shape[0])
    fill_gray(image, places_x, places_y, gray)


def nodes_of(region: Region, view: View) -> NDArray[np.float64]:
    """Source position of every eighth pixel of a region, and its derivative by a shift.

    Returns
    -------
    ndarray, (n, m, 6)
        Place in the picture of the lens, its derivative along columns, and along rows.
    """
    rows = region.height // STEP + 2
    columns = region.width // STEP + 2
    x = region.x + 0.5 + STEP * np.arange(columns)
    y = region.y + 0.5 + STEP * np.arange(rows)
    return places_of(np.stack(np.meshgrid(x, y), axis=-1), view)


def places_of(points: NDArray[np.float64], view: View) -> NDArray[np.float64]:
    """Positions of points of the rectified picture in the frame, with derivatives.

    Parameters
    ----------
    points : ndarray (..., 2), [px]
    view : View

    Returns
    -------
    ndarray (..., 6)
        Place, derivative along columns, derivative along rows.
    """
    probes = [
        (view.source(points + step) - view.source(points - step)) / (2.0 * _PROBE)
        for step in (np.array([_PROBE, 0.0]), np.array([0.0, _PROBE]))
    ]
    return np.ascontiguousarray(np.concatenate([view.source(points), *probes], axis=-1))


def mix_weights(mix: tuple[float, ...]) -> NDArray[np.int64]:
    """Weights of the gray mix as whole numbers of 65536, which keep their sum."""
    shares = np.array(mix, dtype=np.float64) * 65536.0
    weights = np.floor(shares).astype(np.int64)
    left = round(float(shares.sum())) - int(weights.sum())
    for index in np.argsort(weights - shares)[:left]:
        weights[index] += 1
    return weights
