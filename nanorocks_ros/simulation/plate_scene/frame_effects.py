"""Effects on the pixels of a frame: shift, glare, light, noise, gray levels.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.counter_rng import hashed, nearly_normal

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 16
"""Side of the squares that the shift of a picture is given for, [px]."""

# Fixed point: light in units of 2^-13, noise in 2^-19 gray levels.
_LIGHT_BITS = 13
_LEVEL_BITS = 6 + _LIGHT_BITS
ONE = 1 << _LIGHT_BITS
_HALF = 1 << (_LEVEL_BITS - 1)

# Places at which a row may start in the strip of noise.
_STRIP_PLACES = 1 << 16


@compiled
def shift_blocks(
    picture: NDArray[np.uint16],
    still: NDArray[np.uint16],
    shifts: NDArray[np.float64],
    left: int,
    top: int,
) -> None:
    """Copy part of a still picture with a local shift (bilinear).

    Parameters
    ----------
    picture : ndarray of uint16, (3, rows, columns)
        Written, in the part only.
    still : ndarray of uint16, (3, rows, columns)
    shifts : ndarray (m, n, 2), [px]
        Shift of each square along columns and rows; along rows it is interpolated linearly
        between the centres of squares.
    left, top : int, [px]
        Corner of the first square. All must lie so far inside that no source is outside.
    """
    columns = BLOCK * shifts.shape[1]
    share = np.empty((2, columns), dtype=np.float32)
    offset = np.empty((2, columns), dtype=np.int64)
    for a in range(shifts.shape[0]):
        for k in range(columns):
            place = min(max((k + 0.5) / BLOCK - 0.5, 0.0), shifts.shape[1] - 1.0)
            b = min(int(place), max(shifts.shape[1] - 2, 0))
            after = min(b + 1, shifts.shape[1] - 1)
            for axis in range(2):
                before, change = shifts[a, b, axis], shifts[a, after, axis] - shifts[a, b, axis]
                source = -(before + (place - b) * change)
                offset[axis, k] = math.floor(source)
                share[axis, k] = source - offset[axis, k]
        _shift_rows(picture, still, share, offset, left, top + BLOCK * a)


@kernel
def _shift_rows(
    picture: NDArray[np.uint16],
    still: NDArray[np.uint16],
    share: NDArray[np.float32],
    offset: NDArray[np.int64],
    left: int,
    top: int,
) -> None:
    """Shift some rows, in pieces of equal integer offset."""
    start = 0
    while start < offset.shape[1]:
        across, down = offset[0, start], offset[1, start]
        end = start + 1
        while end < offset.shape[1] and offset[0, end] == across and offset[1, end] == down:
            end += 1
        first, last = left + start + across, left + end + across
        for line in range(top, top + BLOCK):
            for channel in range(3):
                _blend(
                    picture[channel, line, left + start : left + end],
                    still[channel, line + down, first : last + 1],
                    still[channel, line + down + 1, first : last + 1],
                    share[0, start:end],
                    share[1, start:end],
                )
        start = end


@kernel
def _blend(
    target: NDArray[np.uint16],
    upper: NDArray[np.uint16],
    lower: NDArray[np.uint16],
    across: NDArray[np.float32],
    down: NDArray[np.float32],
) -> None:
    """Bilinear interpolation of a row of pixels."""
    for j in range(target.size):
        x, y = across[j], down[j]
        high = np.float32(upper[j]) + x * (np.float32(upper[j + 1]) - np.float32(upper[j]))
        low = np.float32(lower[j]) + x * (np.float32(lower[j + 1]) - np.float32(lower[j]))
        target[j] = np.uint16(np.int32(high + y * (low - high) + np.float32(0.5)))


@kernel
def add_light(canvas: NDArray[np.uint16], glare: NDArray[np.uint16], left: int, top: int) -> None:
    """Add light to part of a canvas, limited to white.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns)
        Changed.
    glare : ndarray of uint16, (3, some rows, some columns)
    left, top : int, [px]
        Where its corner is.
    """
    for channel in range(3):
        for i in range(glare.shape[1]):
            line = canvas[channel, top + i, left : left + glare.shape[2]]
            _add_row(line, glare[channel, i])


@kernel
def _add_row(line: NDArray[np.uint16], light: NDArray[np.uint16]) -> None:
    for j in range(line.size):
        value = np.uint32(line[j]) + np.uint32(light[j])
        line[j] = np.uint16(min(value, np.uint32(65535)))


@compiled
def noise_strip(columns: int, noise: float, key: np.uint64) -> NDArray[np.int32]:
    """Strip of sensor noise from which each row takes a random piece, [gray levels / 2^19].

    Parameters
    ----------
    columns : int
        Pixels of a row.
    noise : float, [gray levels]
        Standard deviation.
    key : uint64

    Returns
    -------
    ndarray of int32, (columns + 65535,)
    """
    strip = np.empty(columns + _STRIP_PLACES - 1, dtype=np.int32)
    for i in range(strip.size):
        strip[i] = np.int32(noise * nearly_normal(key, i) * (1 << _LEVEL_BITS))
    return strip


@compiled
def expose(
    canvas: NDArray[np.uint16],
    across: NDArray[np.uint32],
    down: NDArray[np.uint32],
    strip: NDArray[np.int32],
    key: np.uint64,
    picture: NDArray[np.uint8],
) -> None:
    """Convert a canvas to gray levels under uneven light, with noise.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns), [1/64 gray levels]
    across : ndarray of uint32, (columns,)
        Light along a row, in parts of 2^13.
    down : ndarray of uint32, (rows,)
        The same along a column; their product stays below 3 times 2^26.
    strip : ndarray of int32
        See `noise_strip`.
    key : uint64
        Of the frame.
    picture : ndarray of uint8, (rows, 3 columns)
        Written: blue, green and red of each pixel in turn.
    """
    rows, columns = canvas.shape[1:]
    light = np.empty(columns, dtype=np.uint32)
    planes = np.empty((3, columns), dtype=np.uint8)
    places = np.uint64(strip.size - columns + 1)
    for i in range(rows):
        for j in range(columns):
            light[j] = (across[j] * down[i]) >> np.uint32(_LIGHT_BITS)
        for channel in range(3):
            start = np.int64(hashed(key, 3 * i + channel) % places)
            noise = strip[start : start + columns]
            _expose_row(canvas[channel, i], light, noise, planes[channel])
        _interleave(planes, picture[i])


@kernel
def _expose_row(
    canvas: NDArray[np.uint16],
    light: NDArray[np.uint32],
    noise: NDArray[np.int32],
    picture: NDArray[np.uint8],
) -> None:
    for j in range(canvas.size):
        # At most 2^16 times 3 * 2^13, and noise of 300 levels: below 2^31.
        value = np.int32(np.uint32(canvas[j]) * light[j]) + noise[j] + np.int32(_HALF)
        value = value >> np.int32(_LEVEL_BITS)
        picture[j] = np.uint8(min(max(value, np.int32(0)), np.int32(255)))


@kernel
def _interleave(planes: NDArray[np.uint8], row: NDArray[np.uint8]) -> None:
    for j in range(np.uint64(planes.shape[1])):
        for channel in range(np.uint64(3)):
            row[np.uint64(3) * j + channel] = planes[channel, j]
