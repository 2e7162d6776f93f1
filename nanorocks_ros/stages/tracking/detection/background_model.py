"""Background model: the empty floor of a tray, estimated while beads lie and move on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# One row in eight is updated in each frame.
_ROW_SETS = 8
# Weight of a new value: together with the row sets, the time constant is 1 s.
_WEIGHT = 0.2
# Weight of darker values where gray beads may lie.
_SLOW_WEIGHT = 0.004
# Largest relative deviation of a pixel that counts in the change of the light.
_MAX_LIGHT_CHANGE = 0.15
# Chroma above which a pixel is a bead.
_MAX_CHROMA = 0.12
# Brightness over that of the background, below which a pixel of the first frame is a gray bead.
_DARK_SHARE = 0.8
_LEVEL_QUANTILE = 0.85


def initial_background(
    color: NDArray[np.uint8], has_gray: bool, diameter: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Estimate the background from one image with beads.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    has_gray : bool
        Whether the tray has a gray species.
    diameter : int, [px]
        Diameter of the largest beads.

    Returns
    -------
    background : ndarray of float32, (rows, columns, 3), [gray levels]
        The image where no bead lies, elsewhere the mean of the surroundings.
    is_background : ndarray of bool, (rows, columns)
        Pixels without a bead.
    """
    image = color.astype(np.float32)
    blue, red = image[:, :, 0], image[:, :, 2]
    # The median pixel is floor or gray grain: both give the white balance.
    white = float(np.median((red - blue) / np.maximum(red + blue, 1.0)))
    is_background = np.abs(red - blue - white * (red + blue)) <= _MAX_CHROMA * (red + blue)
    if has_gray:
        darkest = image.min(axis=2)
        is_background &= darkest >= _DARK_SHARE * _local_brightness(
            darkest, is_background, 2 * diameter
        )
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
    is_background = cv2.erode(is_background.astype(np.uint8), kernel, borderValue=1).astype(bool)
    if not is_background.any():
        is_background[:] = True
    background = image.copy()
    means = _local_mean(image, is_background, diameter)
    background[~is_background] = means[~is_background]
    return background, is_background


def _local_brightness(
    darkest: NDArray[np.float32], is_background: NDArray[np.bool_], side: int
) -> NDArray[np.float32]:
    """Brightness of the background: a high quantile over blocks, interpolated between them."""
    rows = max(1, round(darkest.shape[0] / side))
    columns = max(1, round(darkest.shape[1] / side))
    levels = np.zeros((rows, columns), dtype=np.float32)
    overall = (
        float(np.quantile(darkest[is_background], _LEVEL_QUANTILE)) if is_background.any() else 0.0
    )
    for i, (row_block, background_block) in enumerate(
        zip(np.array_split(darkest, rows), np.array_split(is_background, rows), strict=True)
    ):
        blocks = zip(
            np.array_split(row_block, columns, axis=1),
            np.array_split(background_block, columns, axis=1),
            strict=True,
        )
        for j, (values, is_usable) in enumerate(blocks):
            has_background = np.count_nonzero(is_usable) > 0.05 * is_usable.size
            level = (
                float(np.quantile(values[is_usable], _LEVEL_QUANTILE))
                if has_background
                else overall
            )
            # A block full of beads shows no background.
            levels[i, j] = max(level, 0.75 * overall)
    return np.asarray(
        cv2.resize(levels, darkest.shape[::-1], interpolation=cv2.INTER_LINEAR), dtype=np.float32
    )


def _local_mean(
    image: NDArray[np.float32], is_background: NDArray[np.bool_], diameter: int
) -> NDArray[np.float32]:
    """Mean of the background pixels around each pixel, from the smallest window that has some."""
    means = np.zeros_like(image)
    missing = np.ones(is_background.shape, dtype=bool)
    side = 2 * diameter + 1
    while missing.any():
        weights = cv2.blur(
            is_background.astype(np.float32), (side, side), borderType=cv2.BORDER_REFLECT
        )
        sums = cv2.blur(
            image * is_background[:, :, None], (side, side), borderType=cv2.BORDER_REFLECT
        )
        has_mean = missing & (weights > 0.02)
        means[has_mean] = (sums / np.maximum(weights, 1e-6)[:, :, None])[has_mean]
        missing &= ~has_mean
        if side > 2 * max(is_background.shape):
            means[missing] = image[is_background].mean(axis=0)
            break
        side = 2 * side + 1
    return means


@compiled
def update_background(
    color: NDArray[np.uint8],
    covered: NDArray[np.uint8],
    has_gray: bool,
    frame: int,
    background: NDArray[np.float32],
    levels: NDArray[np.uint8],
    confirmed: NDArray[np.bool_],
) -> float:
    """Update the background where no bead lies, in one of several sets of rows.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3)
    covered : ndarray of uint8, (rows, columns)
        Nonzero in pixels of beads.
    has_gray : bool
        Whether darker values may be undetected gray beads; they get a small weight.
    frame : int, >= 0
        Number of the frame.
    background : ndarray of float32, (rows, columns, 3), [gray levels]
        Changed.
    levels : ndarray of uint8, (rows, columns, 3)
        Changed: `background`, rounded.
    confirmed : ndarray of bool, (rows, columns)
        Changed: where the background has been visible; elsewhere it is an estimate.

    Returns
    -------
    float
        Brightness of these rows over that of the background before.
    """
    brightness, expected = 1.0, 1.0
    for i in range(frame % _ROW_SETS, color.shape[0], _ROW_SETS):
        for j in range(color.shape[1]):
            if covered[i, j]:
                continue
            blue, red = np.int32(color[i, j, 0]), np.int32(color[i, j, 2])
            redness = (red - blue) - (background[i, j, 2] - background[i, j, 0])
            if abs(redness) > _MAX_CHROMA * (red + blue):
                continue
            green, background_green = np.float64(color[i, j, 1]), np.float64(background[i, j, 1])
            if (
                confirmed[i, j]
                and abs(green - background_green) < _MAX_LIGHT_CHANGE * background_green
            ):
                brightness += green
                expected += background_green
            for k in range(3):
                step = color[i, j, k] - background[i, j, k]
                weight = _WEIGHT if confirmed[i, j] else 1.0
                if has_gray and step < -0.08 * background[i, j, k]:
                    weight = _SLOW_WEIGHT
                background[i, j, k] += weight * step
                # A brighter light may have scaled the background above 255.
                levels[i, j, k] = np.uint8(min(background[i, j, k] + 0.5, 255.0))
            confirmed[i, j] = True
    return brightness / expected
