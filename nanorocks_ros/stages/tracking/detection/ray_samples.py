"""Samples of an image along the rays of a circle, and the edges on them.

Tested by ``test/stages/tracking/detection/test_bead_detector.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Largest number of samples along a ray.
_MAX_SAMPLES = 7


class Samples(NamedTuple):
    """Samples along rays: the innermost samples of all rays first, then further outside.

    Parameters
    ----------
    starts, steps : ndarrays (2, rays), [px]
        Column and row of the end of each ray, and of one step along it.
    indices : ndarray of int32, (samples,)
        Flat index of the pixel to the upper left of each sample.
    right, down : ndarrays (samples,)
        Fraction of the distance to the next pixel.
    corners : ndarray of int32, (4, samples)
        Values of the four pixels around: upper left, upper right, lower left, lower right.
    values : ndarray (samples,)
        Bilinear interpolation.
    outside, step, edges : ndarrays (rays,)
        For each ray: the value outside, the step from there, and the distance of the edge.
    """

    starts: NDArray[np.float64]
    steps: NDArray[np.float64]
    indices: NDArray[np.int32]
    right: NDArray[np.float64]
    down: NDArray[np.float64]
    corners: NDArray[np.int32]
    values: NDArray[np.float64]
    outside: NDArray[np.float64]
    step: NDArray[np.float64]
    edges: NDArray[np.float64]


@compiled
def allocate_samples(rays: int) -> Samples:
    """Allocate uninitialised arrays."""
    size = _MAX_SAMPLES * rays
    return Samples(
        np.empty((2, rays)),
        np.empty((2, rays)),
        np.empty(size, dtype=np.int32),
        np.empty(size),
        np.empty(size),
        np.empty((4, size), dtype=np.int32),
        np.empty(size),
        np.empty(rays),
        np.empty(rays),
        np.empty(rays),
    )


@inlined
def sample_rays(
    pixels: NDArray[np.integer[Any]],
    width: int,
    sign: float,
    reach: int,
    count: int,
    samples: Samples,
) -> None:
    """Sample an image along rays; each step is a loop over all samples."""
    start_x, start_y = samples.starts[0], samples.starts[1]
    step_x, step_y = samples.steps[0], samples.steps[1]
    columns = np.int32(width)
    for t in range(-reach, reach + 1):
        first = (t + reach) * count
        indices = samples.indices[first : first + count]
        right, down = samples.right[first : first + count], samples.down[first : first + count]
        for q in range(count):
            x, y = start_x[q] + t * step_x[q], start_y[q] + t * step_y[q]
            column, row = np.int32(x), np.int32(y)
            indices[q] = row * columns + column
            right[q], down[q] = x - column, y - row
    one, below = np.uint64(1), np.uint64(width)
    upper_left, upper_right = samples.corners[0], samples.corners[1]
    lower_left, lower_right = samples.corners[2], samples.corners[3]
    right, down, values = samples.right, samples.down, samples.values
    for q in range((2 * reach + 1) * count):
        # Unsigned indices need no test for negative values.
        k = np.uint64(samples.indices[q])
        upper_left[q], upper_right[q] = pixels[k], pixels[k + one]
        lower_left[q], lower_right[q] = pixels[k + below], pixels[k + below + one]
    for q in range((2 * reach + 1) * count):
        upper = upper_left[q] * (1.0 - right[q]) + upper_right[q] * right[q]
        lower = lower_left[q] * (1.0 - right[q]) + lower_right[q] * right[q]
        values[q] = sign * (upper * (1.0 - down[q]) + lower * down[q])


@inlined
def find_edges(
    reach: int, min_step: float, max_outside: float, count: int, samples: Samples
) -> None:
    """Distance of an edge from the end of each ray, [px]; NaN where there is none."""
    outside, step, edges = samples.outside, samples.step, samples.edges
    innermost, inner = samples.values[:count], samples.values[count : 2 * count]
    last = 2 * reach * count
    outer, outermost = samples.values[last - count : last], samples.values[last : last + count]
    for q in range(count):
        outside[q] = 0.5 * (outermost[q] + outer[q])
        step[q] = 0.5 * (inner[q] + innermost[q]) - outside[q]
        # The outermost samples are 1 and 0 by the choice of the levels.
        total = 1.0 - (reach + 0.5)
        total += min(max((inner[q] - outside[q]) / step[q], 0.0), 1.0)
        edges[q] = total + min(max((outer[q] - outside[q]) / step[q], 0.0), 1.0)
    for t in range(2, 2 * reach - 1):
        values = samples.values[t * count : (t + 1) * count]
        for q in range(count):
            edges[q] += min(max((values[q] - outside[q]) / step[q], 0.0), 1.0)
    max_sum = 2.0 * max_outside
    for q in range(count):
        no_edge = (outer[q] > max_sum) | (outermost[q] > max_sum) | (outside[q] > max_outside)
        edges[q] = np.nan if no_edge | (step[q] < min_step) else edges[q]
