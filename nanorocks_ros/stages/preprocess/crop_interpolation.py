"""Bilinear interpolation of whole crops in integers, in compiled functions.

Tested by ``test/stages/preprocess/test_rectify.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Pixels between two nodes; the bend of a lens within them is below 0.005 px.
STEP = 8
# Places are whole numbers of 1/16384 px, weights of 1/128.
_FRACTION, _WEIGHT = 14, 7
_PIXEL = np.int32(1 << _FRACTION)
_HALF = np.int32(1 << (2 * _WEIGHT - 1))
_CHANNELS = 3
# Which of the pixels of a run each byte of a colour picture belongs to.
_OF_BYTE = np.repeat(np.arange(STEP, dtype=np.int32), _CHANNELS)


@compiled
def moved(
    nodes: NDArray[np.float64], shift: tuple[float, float], axis: int, pixels: int
) -> NDArray[np.int32]:
    """Where the nodes lie along one axis, kept near the picture."""
    places = np.empty(nodes.shape[:2], dtype=np.int32)
    for i in range(nodes.shape[0]):
        for j in range(nodes.shape[1]):
            place = nodes[i, j, axis] - 0.5
            place += nodes[i, j, 2 + axis] * shift[0] + nodes[i, j, 4 + axis] * shift[1]
            place = min(max(place, -1.0 * pixels), 2.0 * pixels)
            # Half a weight more, so that cutting off the rest rounds.
            places[i, j] = np.int32(place * (1 << _FRACTION)) + (1 << (_FRACTION - _WEIGHT - 1))
    return places


@compiled
def _within(place: np.int32, last: np.int32) -> np.int32:
    return np.int32(min(max(place, np.int32(0)), last))


@compiled
def _last(pixels: int) -> np.int32:
    """The last place with a neighbour, which gets almost all of the weight."""
    return np.int32(((pixels - 1) << _FRACTION) - 1)


@compiled
def _between(low: np.int32, high: np.int32, eighths: np.int32) -> np.int32:
    return np.int32(low + (((high - low) * eighths) >> 3))


@compiled
def _run(places: NDArray[np.int32], i: int, j: int, down: np.int32) -> tuple[np.int32, np.int32]:
    """Where eight pixels of a row begin along one axis, and the step from one to the next."""
    first = _between(places[i, j], places[i + 1, j], down)
    last = _between(places[i, j + 1], places[i + 1, j + 1], down)
    return first, np.int32((last - first) >> 3)


@compiled
def _blend(
    pixels: NDArray[np.uint8],
    here: np.uint64,
    right: np.uint64,
    below: np.uint64,
    x: np.int32,
    y: np.int32,
) -> np.int32:
    """Bilinear interpolation at the fractions x, y of 128, from a place in a flat picture."""
    w11 = np.int32(x * y)
    w10 = np.int32((y << _WEIGHT) - w11)
    w01 = np.int32((x << _WEIGHT) - w11)
    w00 = np.int32((1 << 2 * _WEIGHT) - w11 - w10 - w01)
    return np.int32(
        (
            w00 * np.int32(pixels[here])
            + w01 * np.int32(pixels[here + right])
            + w10 * np.int32(pixels[here + below])
            + w11 * np.int32(pixels[here + below + right])
            + _HALF
        )
        >> (2 * _WEIGHT)
    )


@compiled
def inside(places: NDArray[np.int32], pixels: int) -> bool:
    """Whether all places along an axis are at least a pixel away from the edges of a picture."""
    return bool(places.min() >= _PIXEL and places.max() <= _last(pixels) - _PIXEL)


@compiled
def fill_by_pixels(
    image: NDArray[np.uint8],
    places_x: NDArray[np.int32],
    places_y: NDArray[np.int32],
    first: int,
    color: NDArray[np.uint8],
) -> None:
    """Fill the rows of a crop from one on; beyond the edge of the picture that of the edge."""
    rows, columns, _ = color.shape
    # Unsigned places in flat arrays: a signed one is compared with 0 each time.
    pixels, out = image.reshape(-1), color.reshape(-1)
    below, right = np.uint64(3 * image.shape[1]), np.uint64(3)
    one, two = np.uint64(1), np.uint64(2)
    last_x, last_y = _last(image.shape[1]), _last(image.shape[0])
    for row in range(first, rows):
        i, down = row // STEP, np.int32(row % STEP)
        for j in range((columns + STEP - 1) // STEP):
            x, step_x = _run(places_x, i, j, down)
            y, step_y = _run(places_y, i, j, down)
            for column in range(j * STEP, min(columns, (j + 1) * STEP)):
                u, v = _within(x, last_x), _within(y, last_y)
                here = np.uint64((v >> _FRACTION) * 3 * image.shape[1] + (u >> _FRACTION) * 3)
                a, b = np.int32((u >> _WEIGHT) & 127), np.int32((v >> _WEIGHT) & 127)
                v0 = _blend(pixels, here, right, below, a, b)
                v1 = _blend(pixels, here + one, right, below, a, b)
                v2 = _blend(pixels, here + two, right, below, a, b)
                place = right * np.uint64(row * columns + column)
                out[place] = np.uint8(v0)
                out[place + one] = np.uint8(v1)
                out[place + two] = np.uint8(v2)
                x, y = np.int32(x + step_x), np.int32(y + step_y)


@compiled
def fill_gray(
    image: NDArray[np.uint8],
    places_x: NDArray[np.int32],
    places_y: NDArray[np.int32],
    gray: NDArray[np.uint8],
) -> None:
    """The same for a whole picture without colours, (height, width)."""
    rows, columns = gray.shape
    pixels, out = image.reshape(-1), gray.reshape(-1)
    below, right = np.uint64(image.shape[1]), np.uint64(1)
    last_x, last_y = _last(image.shape[1]), _last(image.shape[0])
    for row in range(rows):
        i, down = row // STEP, np.int32(row % STEP)
        for j in range((columns + STEP - 1) // STEP):
            x, step_x = _run(places_x, i, j, down)
            y, step_y = _run(places_y, i, j, down)
            for column in range(j * STEP, min(columns, (j + 1) * STEP)):
                u, v = _within(x, last_x), _within(y, last_y)
                here = np.uint64((v >> _FRACTION) * image.shape[1] + (u >> _FRACTION))
                a, b = np.int32((u >> _WEIGHT) & 127), np.int32((v >> _WEIGHT) & 127)
                out[np.uint64(row * columns + column)] = np.uint8(
                    _blend(pixels, here, right, below, a, b)
                )
                x, y = np.int32(x + step_x), np.int32(y + step_y)


@compiled
def fill_by_runs(
    image: NDArray[np.uint8],
    places_x: NDArray[np.int32],
    places_y: NDArray[np.int32],
    rows: int,
    color: NDArray[np.uint8],
) -> None:
    """Fill the first rows of a crop that lies inside the picture; the next row is spoilt.

    Most runs of eight pixels come from eight that lie side by side, and are interpolated all at
    once. Where one is left out or taken twice, or the row changes, another eight from there on
    are written over them.
    """
    columns, width = color.shape[1], image.shape[1]
    pixels, out = image.reshape(-1), color.reshape(-1)
    starts = np.empty(((columns + STEP - 1) // STEP, 4), dtype=np.int32)
    for row in range(rows):
        _runs(places_x, row, starts[:, :2])
        _runs(places_y, row, starts[:, 2:])
        for j in range(starts.shape[0]):
            x, step_x, y, step_y = starts[j]
            drift = np.int32(step_x - _PIXEL)
            to, done = np.uint64(3 * (row * columns + j * STEP)), 0
            while done < STEP:
                here = np.uint64(((y >> _FRACTION) * width + (x >> _FRACTION)) * 3)
                _side_by_side(pixels, here, width, (x, step_x), (y, step_y), out, to)
                # Beside each other as long as neither leaves its pixel.
                u, v = np.int32(x & (_PIXEL - 1)), np.int32(y & (_PIXEL - 1))
                left = np.int32(STEP - 1 - done)
                if _both_in_pixel(np.int32(u + left * drift), np.int32(v + left * step_y)):
                    break
                count = 0
                while _both_in_pixel(u, v):
                    u, v = np.int32(u + drift), np.int32(v + step_y)
                    x, y = np.int32(x + step_x), np.int32(y + step_y)
                    count += 1
                to += np.uint64(3 * count)
                done += count


@compiled
def _runs(places: NDArray[np.int32], row: int, runs: NDArray[np.int32]) -> None:
    """Beginnings and steps along one axis of all runs of a row, (runs, 2)."""
    for j in range(runs.shape[0]):
        runs[j, 0], runs[j, 1] = _run(places, row // STEP, j, np.int32(row % STEP))


@compiled
def _both_in_pixel(u: np.int32, v: np.int32) -> bool:
    """Whether two places are from 0 on and below 1 px."""
    return bool(np.uint32(u | v) < np.uint32(_PIXEL))


@compiled
def _side_by_side(
    pixels: NDArray[np.uint8],
    here: np.uint64,
    width: int,
    across: tuple[np.int32, np.int32],
    down: tuple[np.int32, np.int32],
    out: NDArray[np.uint8],
    to: np.uint64,
) -> None:
    """`blend` for the eight pixels from a place on, by where the first is and the steps."""
    right, below = np.uint64(_CHANNELS), np.uint64(_CHANNELS * width)
    for byte in range(STEP * _CHANNELS):
        k = np.uint64(byte)
        x = np.int32(across[0] + _OF_BYTE[k] * across[1])
        y = np.int32(down[0] + _OF_BYTE[k] * down[1])
        a, b = np.int16((x >> _WEIGHT) & 127), np.int32((y >> _WEIGHT) & 127)
        above = _weighted(pixels[here + k], pixels[here + k + right], a)
        under = _weighted(pixels[here + below + k], pixels[here + below + k + right], a)
        level = np.int32((above << _WEIGHT) + b * (under - above) + _HALF)
        out[to + k] = np.uint8(level >> (2 * _WEIGHT))


@compiled
def _weighted(left: np.uint8, right: np.uint8, share: np.int16) -> np.int32:
    """Interpolation between two pixels, times 128: it fits into 16 bits."""
    first = np.int16(left)
    return np.int32(np.int16((first << _WEIGHT) + np.int16(share * np.int16(right - first))))


@compiled
def mix_levels(color: NDArray[np.uint8], mix: NDArray[np.int64], gray: NDArray[np.uint8]) -> None:
    """The gray mix of a picture, by weights of 65536."""
    levels, out = color.reshape(-1), gray.reshape(-1)
    m0, m1, m2 = np.int32(mix[0]), np.int32(mix[1]), np.int32(mix[2])
    for number in range(out.size):
        k = np.uint64(number)
        place = np.uint64(3) * k
        v0, v1 = np.int32(levels[place]), np.int32(levels[place + np.uint64(1)])
        v2 = np.int32(levels[place + np.uint64(2)])
        level = np.int32(m0 * v0 + m1 * v1 + m2 * v2 + np.int32(32768))
        out[k] = np.uint8(level >> 16)
