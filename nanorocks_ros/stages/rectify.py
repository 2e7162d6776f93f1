"""From the picture of the lens to the straight crop of one tray, its colours and its gray mix.

The lens bends lines so gently that where a pixel comes from is worked out at every eighth pixel
only, and each pixel is interpolated once, straight from the frame: lens, pose of the plate and
motion of the tray in one go.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.view import View

# Pixels between two nodes; the bend of a lens within them is below 0.005 px.
STEP = 8
# Step of the numerical derivative of the view, [px].
_PROBE = 0.5

# Places are whole numbers of 1/16384 px, weights of 1/128.
_FRACTION, _WEIGHT = 14, 7
_HALF = np.int32(1 << (2 * _WEIGHT - 1))


@compiled
def _moved(
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
    # Unsigned places in flat arrays: a signed one is compared with 0 each time.
    pixels, out, out_gray = image.reshape(-1), color.reshape(-1), gray.reshape(-1)
    below, right = np.uint64(3 * image.shape[1]), np.uint64(3)
    one, two = np.uint64(1), np.uint64(2)
    m0, m1, m2 = np.int32(mix[0]), np.int32(mix[1]), np.int32(mix[2])
    places_x = _moved(nodes, shift, 0, image.shape[1])
    places_y = _moved(nodes, shift, 1, image.shape[0])
    last_x, last_y = _last(image.shape[1]), _last(image.shape[0])
    for row in range(rows):
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
                place = np.uint64(row * columns + column)
                out[right * place] = np.uint8(v0)
                out[right * place + one] = np.uint8(v1)
                out[right * place + two] = np.uint8(v2)
                level = np.int32(m0 * v0 + m1 * v1 + m2 * v2 + np.int32(32768))
                out_gray[place] = np.uint8(level >> 16)
                x, y = np.int32(x + step_x), np.int32(y + step_y)


@compiled
def resample_gray(
    image: NDArray[np.uint8],
    nodes: NDArray[np.float64],
    shift: tuple[float, float],
    gray: NDArray[np.uint8],
) -> None:
    """The same for a picture without colours, (height, width)."""
    rows, columns = gray.shape
    pixels, out = image.reshape(-1), gray.reshape(-1)
    below, right = np.uint64(image.shape[1]), np.uint64(1)
    places_x = _moved(nodes, shift, 0, image.shape[1])
    places_y = _moved(nodes, shift, 1, image.shape[0])
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


def nodes_of(region: Region, view: View) -> NDArray[np.float64]:
    """Where every eighth pixel of a region comes from, and how that follows a shift.

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
    """Where points of the rectified picture are in that of the lens, with derivatives.

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
