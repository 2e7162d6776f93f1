"""The empty floor of a tray, learnt while beads lie and move on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Rows of which one is renewed at each picture; the rest wait their turn.
_ROWS_IN_TURN = 8
# Share of a new value taken over: with the turn, a light that changes is followed in a second.
_SHARE = 0.2
# Where a gray bead may lie, darker values are believed slowly.
_SLOW_SHARE = 0.004
# Of its level, what differs more from the floor says nothing of the light as a whole.
_LIKE_FLOOR = 0.15
# Chroma above which a pixel is surely a bead, at the first picture.
_COLOURED = 0.12
# Of the local level of the floor: darker pixels of the first picture are gray beads.
_DARK = 0.8
_LEVEL_QUANTILE = 0.85


def first_floor(
    color: NDArray[np.uint8], gray_known: bool, reach: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Guess the empty floor from one picture with beads on it.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    gray_known : bool
        Whether beads may be gray.
    reach : int, [px]
        Diameter of the largest beads.

    Returns
    -------
    floor : ndarray of float32, (rows, columns, 3), [gray levels]
        The picture where no bead lies, else what lies around.
    free : ndarray of bool, (rows, columns)
        Where no bead seems to lie.
    """
    picture = color.astype(np.float32)
    blue, red = picture[:, :, 0], picture[:, :, 2]
    # The median pixel is floor, or gray grains: either tells the white of the light.
    white = float(np.median((red - blue) / np.maximum(red + blue, 1.0)))
    free = np.abs(red - blue - white * (red + blue)) <= _COLOURED * (red + blue)
    if gray_known:
        low = picture.min(axis=2)
        free &= low >= _DARK * _local_level(low, free, 2 * reach)
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
    free = cv2.erode(free.astype(np.uint8), shape, borderValue=1).astype(bool)
    if not free.any():
        free[:] = True
    floor = picture.copy()
    around = _mean_around(picture, free, reach)
    floor[~free] = around[~free]
    return floor, free


def _local_level(
    low: NDArray[np.float32], free: NDArray[np.bool_], side: int
) -> NDArray[np.float32]:
    """How bright the floor is: a high quantile over squares, smoothly between them."""
    rows = max(1, round(low.shape[0] / side))
    columns = max(1, round(low.shape[1] / side))
    levels = np.zeros((rows, columns), dtype=np.float32)
    overall = float(np.quantile(low[free], _LEVEL_QUANTILE)) if free.any() else 0.0
    for i, (some_rows, some_free) in enumerate(
        zip(np.array_split(low, rows), np.array_split(free, rows), strict=True)
    ):
        pairs = zip(
            np.array_split(some_rows, columns, axis=1),
            np.array_split(some_free, columns, axis=1),
            strict=True,
        )
        for j, (values, usable) in enumerate(pairs):
            enough = np.count_nonzero(usable) > 0.05 * usable.size
            here = float(np.quantile(values[usable], _LEVEL_QUANTILE)) if enough else overall
            # A square full of beads shows no floor.
            levels[i, j] = max(here, 0.75 * overall)
    return np.asarray(
        cv2.resize(levels, low.shape[::-1], interpolation=cv2.INTER_LINEAR), dtype=np.float32
    )


def _mean_around(
    picture: NDArray[np.float32], free: NDArray[np.bool_], reach: int
) -> NDArray[np.float32]:
    """Mean of the free pixels around each, from as near as there are any."""
    found = np.zeros_like(picture)
    missing = np.ones(free.shape, dtype=bool)
    side = 2 * reach + 1
    while missing.any():
        weights = cv2.blur(free.astype(np.float32), (side, side), borderType=cv2.BORDER_REFLECT)
        sums = cv2.blur(picture * free[:, :, None], (side, side), borderType=cv2.BORDER_REFLECT)
        known = missing & (weights > 0.02)
        found[known] = (sums / np.maximum(weights, 1e-6)[:, :, None])[known]
        missing &= ~known
        if side > 2 * max(free.shape):
            found[missing] = picture[free].mean(axis=0)
            break
        side = 2 * side + 1
    return found


@compiled
def renew_floor(
    color: NDArray[np.uint8],
    covered: NDArray[np.uint8],
    gray_known: bool,
    turn: int,
    floor: NDArray[np.float32],
    levels: NDArray[np.uint8],
    sure: NDArray[np.bool_],
) -> float:
    """Follow the floor where no bead lies, in one of several sets of rows.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3)
    covered : ndarray of uint8, (rows, columns)
        Not 0 in pixels of beads.
    gray_known : bool
        Darker values may be gray beads that were not found, and are believed slowly.
    turn : int, >= 0
        Number of the picture.
    floor : ndarray of float32, (rows, columns, 3), [gray levels]
        Changed.
    levels : ndarray of uint8, (rows, columns, 3)
        Changed: the same, rounded.
    sure : ndarray of bool, (rows, columns)
        Changed: where the floor itself has been seen; elsewhere it is a guess.

    Returns
    -------
    float
        How bright these rows were, relative to the floor as it was known.
    """
    shown, known = 1.0, 1.0
    for i in range(turn % _ROWS_IN_TURN, color.shape[0], _ROWS_IN_TURN):
        for j in range(color.shape[1]):
            if covered[i, j]:
                continue
            blue, red = np.int32(color[i, j, 0]), np.int32(color[i, j, 2])
            warm = (red - blue) - (floor[i, j, 2] - floor[i, j, 0])
            if abs(warm) > _COLOURED * (red + blue):
                continue
            green, floor_g = np.float64(color[i, j, 1]), np.float64(floor[i, j, 1])
            if sure[i, j] and abs(green - floor_g) < _LIKE_FLOOR * floor_g:
                shown += green
                known += floor_g
            for k in range(3):
                step = color[i, j, k] - floor[i, j, k]
                share = _SHARE if sure[i, j] else 1.0
                if gray_known and step < -0.08 * floor[i, j, k]:
                    share = _SLOW_SHARE
                floor[i, j, k] += share * step
                # A light that became brighter may have taken the floor beyond white.
                levels[i, j, k] = np.uint8(min(floor[i, j, k] + 0.5, 255.0))
            sure[i, j] = True
    return shown / known
