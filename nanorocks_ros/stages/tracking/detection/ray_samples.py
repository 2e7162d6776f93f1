"""What a picture shows along the rays of a circle, and the edges there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Places along a ray where a picture is looked at.
_MOST_SAMPLES = 7


class Samples(NamedTuple):
    """What a picture shows along rays: of all of them inside first, then further outside.

    Parameters
    ----------
    starts, steps : ndarrays (2, rays), [px]
        Of each ray: column and row of its end, and of one step along it.
    places : ndarray of int32, (places,)
        The pixel to the upper left of each place, counted from the first one, row by row.
    right, down : ndarrays (places,)
        Share of the way to the next pixel.
    corners : ndarray of int32, (4, places)
        Of the four pixels around: upper left, upper right, lower left, lower right.
    values : ndarray (places,)
        Between the pixels.
    outside, step, edges : ndarrays (rays,)
        Of each ray: the value outside, the step from there, and the distance of the edge.
    """

    starts: NDArray[np.float64]
    steps: NDArray[np.float64]
    places: NDArray[np.int32]
    right: NDArray[np.float64]
    down: NDArray[np.float64]
    corners: NDArray[np.int32]
    values: NDArray[np.float64]
    outside: NDArray[np.float64]
    step: NDArray[np.float64]
    edges: NDArray[np.float64]


@compiled
def room_for_samples(rays: int) -> Samples:
    """Room that nothing is written in yet."""
    most = _MOST_SAMPLES * rays
    return Samples(
        np.empty((2, rays)),
        np.empty((2, rays)),
        np.empty(most, dtype=np.int32),
        np.empty(most),
        np.empty(most),
        np.empty((4, most), dtype=np.int32),
        np.empty(most),
        np.empty(rays),
        np.empty(rays),
        np.empty(rays),
    )


@inlined
def look_along(
    pixels: NDArray[np.integer[Any]],
    width: int,
    sign: float,
    reach: int,
    count: int,
    samples: Samples,
) -> None:
    """Look at a picture along some rays: each step for many places at once."""
    start_x, start_y = samples.starts[0], samples.starts[1]
    step_x, step_y = samples.steps[0], samples.steps[1]
    columns = np.int32(width)
    for t in range(-reach, reach + 1):
        first = (t + reach) * count
        places = samples.places[first : first + count]
        right, down = samples.right[first : first + count], samples.down[first : first + count]
        for q in range(count):
            x, y = start_x[q] + t * step_x[q], start_y[q] + t * step_y[q]
            column, row = np.int32(x), np.int32(y)
            places[q] = row * columns + column
            right[q], down[q] = x - column, y - row
    one, below = np.uint64(1), np.uint64(width)
    upper_left, upper_right = samples.corners[0], samples.corners[1]
    lower_left, lower_right = samples.corners[2], samples.corners[3]
    right, down, values = samples.right, samples.down, samples.values
    for q in range((2 * reach + 1) * count):
        # Unsigned places need no look at whether they count from the end.
        k = np.uint64(samples.places[q])
        upper_left[q], upper_right[q] = pixels[k], pixels[k + one]
        lower_left[q], lower_right[q] = pixels[k + below], pixels[k + below + one]
    for q in range((2 * reach + 1) * count):
        upper = upper_left[q] * (1.0 - right[q]) + upper_right[q] * right[q]
        lower = lower_left[q] * (1.0 - right[q]) + lower_right[q] * right[q]
        values[q] = sign * (upper * (1.0 - down[q]) + lower * down[q])


@inlined
def find_edges(
    reach: int, least: float, most_outside: float, count: int, samples: Samples
) -> None:
    """Distance of an edge from the end of each ray, [px]; NaN where there is none."""
    outside, step, edges = samples.outside, samples.step, samples.edges
    nearest, near = samples.values[:count], samples.values[count : 2 * count]
    last = 2 * reach * count
    far, farthest = samples.values[last - count : last], samples.values[last : last + count]
    for q in range(count):
        outside[q] = 0.5 * (farthest[q] + far[q])
        step[q] = 0.5 * (near[q] + nearest[q]) - outside[q]
        # The outermost samples are 1 and 0 by the choice of the levels.
        total = 1.0 - (reach + 0.5)
        total += min(max((near[q] - outside[q]) / step[q], 0.0), 1.0)
        edges[q] = total + min(max((far[q] - outside[q]) / step[q], 0.0), 1.0)
    for t in range(2, 2 * reach - 1):
        values = samples.values[t * count : (t + 1) * count]
        for q in range(count):
            edges[q] += min(max((values[q] - outside[q]) / step[q], 0.0), 1.0)
    most = 2.0 * most_outside
    for q in range(count):
        none = (far[q] > most) | (farthest[q] > most) | (outside[q] > most_outside)
        edges[q] = np.nan if none | (step[q] < least) else edges[q]
