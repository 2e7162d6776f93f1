"""Edges along the rays of a disc, and the outline through them, compiled.

Tested by ``test/stages/tracking/scene/outlines/test_outline_fits.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.numerics.small_cholesky import eliminate

RAYS = 24
RESULTS = 9
"""Of an outline: column, row, radius, errors of both, support, step, smear, longest open part."""

# Samples along a ray are this far apart at least, [px], and so many at most, by iteration.
_SAMPLE_PX, _MAX_SAMPLES = 0.5, (16, 24)
_LEAST_REACH_PX = 1.5
# Places and values between pixels as integers, over these units.
_PLACE, _VALUE = 2.0**32, 2.0**-24
# Edges this far from the outline do not count: part of the radius, and at least, [px].
_OFF_SHARE, _OFF_PX = 0.12, 0.8
# Smallest scatter of an edge, [px], and edges that tell an outline.
_LEAST_SCATTER_PX, _LEAST_EDGES = 0.08, 6
# Neighbouring rays share pixels.
_CORRELATION_FACTOR = 1.6
_ITERATIONS = 4
# Part of the outline below which a disc is not fitted further.
_LEAST_SUPPORT = 0.25


class Search(NamedTuple):
    """What edges are searched.

    Parameters
    ----------
    sign : int
        1: inside is brighter, -1: darker, 0: either.
    least : float
        Smallest step of an edge.
    smallest, largest : float, [px]
        Radii.
    shape : ndarray (RAYS, n)
        Cosine and sine of each ray, where the outline of a circle of radius 1 shows on it, and of
        smeared discs cosine and sine of twice its angle: the outline is a sum of these.
    """

    sign: int
    least: float
    smallest: float
    largest: float
    shape: NDArray[np.float64]


class Scratch(NamedTuple):
    """Arrays that `fit_each` writes to; see `scratch`.

    Of each ray, `edges` has the distance of its edge, the step, and 1 where there is one.
    """

    edges: NDArray[np.float64]
    profile: NDArray[np.float64]
    rises: NDArray[np.float64]
    weights: NDArray[np.float64]
    off: NDArray[np.float64]
    normal: NDArray[np.float64]
    matrix: NDArray[np.float64]
    right: NDArray[np.float64]
    fitted: NDArray[np.float64]


def scratch(terms: int) -> Scratch:
    """Arrays for outlines of so many terms."""
    profile, rises = np.empty((2, _MAX_SAMPLES[1]))
    weights, off = np.empty((2, RAYS))
    normal, matrix = np.empty((2, terms, terms))
    right, fitted = np.empty((2, terms))
    edges = np.empty((RAYS, 3))
    return Scratch(edges, profile, rises, weights, off, normal, matrix, right, fitted)


@kernel
def fit_each(
    picture: NDArray[np.uint8],
    discs: NDArray[np.float64],
    search: Search,
    reaches: tuple[float, float],
    work: Scratch,
    results: NDArray[np.float64],
) -> None:
    """Fit an outline to the edges around each disc.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns)
    discs : ndarray (n, 3), [px]
        Where to begin: column, row, radius.
    search : Search
    reaches : tuple of 2 floats
        Part of the radius on either side of the outline that is searched, by iteration.
    work : Scratch
    results : ndarray (n, RESULTS)
        Written.
    """
    terms = search.shape.shape[1]
    for k in range(len(discs)):
        for i in range(RESULTS):
            results[k, i] = discs[k, i] if i < 3 else 0.0
        for term in range(terms):
            work.fitted[term] = 0.0
        scatter = 0.0
        for turn in range(len(reaches)):
            if turn > 0 and results[k, 5] < _LEAST_SUPPORT:
                break
            half_width = max(reaches[turn] * results[k, 2], _LEAST_REACH_PX)
            samples = math.ceil(2.0 * half_width / _SAMPLE_PX) + 3
            samples = min(_MAX_SAMPLES[turn], samples)
            for ray in range(RAYS):
                middle = results[k, 2] * search.shape[ray, 2]
                for term in range(3, terms):
                    middle += work.fitted[term] * search.shape[ray, term]
                _edge(picture, results, k, search, ray, middle, half_width, samples, work)
            scatter = _fit(search, results, k, work)
        _write_errors(search, results, k, scatter, work)


@inlined
def _edge(
    picture: NDArray[np.uint8],
    results: NDArray[np.float64],
    k: int,
    search: Search,
    ray: int,
    middle: float,
    half_width: float,
    samples: int,
    work: Scratch,
) -> None:
    """Distance of the edge on a ray of disc `k`, its step, and 1 where there is one."""
    pitch = 2.0 / (samples - 1)
    across, down = search.shape[ray, 0], search.shape[ray, 1]
    within, usable = middle >= half_width, True
    column, row = results[k, 0], results[k, 1]
    for end in range(2):
        along = max(middle + (2 * end - 1) * half_width, 0.0)
        x, y = column + across * along, row + down * along
        usable &= 0.0 <= x < picture.shape[1] and 0.0 <= y < picture.shape[0]
        within &= 1e-3 <= x < picture.shape[1] - 1.001 and 1e-3 <= y < picture.shape[0] - 1.001
    if within:
        # Between two places in the picture all are.
        first, step = middle - half_width, half_width * pitch
        start = column + across * first, row + down * first
        _sample(picture, start, (across * step, down * step), samples, work.profile)
    else:
        for i in range(samples):
            along = max(middle + half_width * (i * pitch - 1.0), 0.0)
            work.profile[i] = _value(picture, column + across * along, row + down * along)
    # Step over a length of about two pixels.
    half = max(1, round(1.0 / (pitch * half_width)))
    count = samples - 2 * half
    for i in range(count):
        rise = work.profile[i] - work.profile[i + 2 * half]
        work.rises[i] = abs(rise) if search.sign == 0 else search.sign * rise
    best = _steepest(work.rises, count, half, pitch)
    before, at, after = work.rises[best - 1], work.rises[best], work.rises[best + 1]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    place = (best + half) * pitch - 1.0 + pitch * min(max(shift, -0.5), 0.5)
    work.edges[ray, 0], work.edges[ray, 1] = middle + half_width * place, at
    usable &= at > search.least and at >= before and at >= after
    work.edges[ray, 2] = 1.0 if usable else 0.0


@inlined
def _steepest(rises: NDArray[np.float64], count: int, half: int, pitch: float) -> int:
    """Of the steepest places, among equal ones that nearest to where the outline was before."""
    best, rated = 1, 0.0
    for i in range(1, count - 1):
        if rises[i] >= rises[i - 1] and rises[i] > rises[i + 1]:
            rating = rises[i] * (1.0 - 0.5 * abs((i + half) * pitch - 1.0))
            if rating > rated:
                best, rated = i, rating
    return best


@inlined
def _value(picture: NDArray[np.uint8], x: float, y: float) -> float:
    """The picture between its pixels; beyond its border as on it."""
    # Never below 0, so that numba need not count from the end; NaN counts as 0.
    x = min(x, picture.shape[1] - 1.001) if x > 0.0 else 0.0
    y = min(y, picture.shape[0] - 1.001) if y > 0.0 else 0.0
    column, row = np.uint64(x), np.uint64(y)
    next_column, next_row = column + np.uint64(1), row + np.uint64(1)
    right, below = x - np.float64(column), y - np.float64(row)
    upper = picture[row, column] + right * (
        np.float64(picture[row, next_column]) - picture[row, column]
    )
    lower = picture[next_row, column] + right * (
        np.float64(picture[next_row, next_column]) - picture[next_row, column]
    )
    return float(upper + below * (lower - upper))


@inlined
def _sample(
    picture: NDArray[np.uint8],
    start: tuple[float, float],
    step: tuple[float, float],
    count: int,
    profile: NDArray[np.float64],
) -> None:
    """The picture at so many places from a start on, all of them within it.

    In integers: conversions from and to floats would take most of the time. A place has 32 bits
    after the point, of which the weights of its neighbours have 12.
    """
    # Negative steps are those modulo 2**64.
    x, y = np.uint64(np.int64(start[0] * _PLACE)), np.uint64(np.int64(start[1] * _PLACE))
    across, down = np.uint64(np.int64(step[0] * _PLACE)), np.uint64(np.int64(step[1] * _PLACE))
    one, whole, fraction = np.uint64(1), np.uint64(32), np.uint64(20)
    full, mask = np.uint64(4096), np.uint64(4095)
    for i in range(count):
        column, row = x >> whole, y >> whole
        right, below = (x >> fraction) & mask, (y >> fraction) & mask
        left, above = full - right, full - below
        upper = left * picture[row, column] + right * picture[row, column + one]
        lower = left * picture[row + one, column] + right * picture[row + one, column + one]
        profile[i] = np.float64(np.int64(above * upper + below * lower)) * _VALUE
        x += across
        y += down


@inlined
def _fit(search: Search, results: NDArray[np.float64], k: int, work: Scratch) -> float:
    """The outline through the edges, without those that lie off, as linear least squares.

    Returns the scatter of the edges.
    """
    terms = search.shape.shape[1]
    edges, weights, off, fitted = work.edges, work.weights, work.off, work.fitted
    for ray in range(RAYS):
        weights[ray] = edges[ray, 2]
    limit = 0.0
    for _ in range(_ITERATIONS):
        _sum_up(search.shape, work, 1e-9)
        _solve(work.normal, work)
        limit = max(_OFF_SHARE * abs(fitted[2]), _OFF_PX)
        for ray in range(RAYS):
            off[ray] = edges[ray, 0]
            for term in range(terms):
                off[ray] -= search.shape[ray, term] * fitted[term]
            part = max(0.0, 1.0 - (off[ray] / (2.0 * limit)) ** 2)
            weights[ray] = edges[ray, 2] * part * part
    count, squares, steps = 0, 0.0, 0.0
    for ray in range(RAYS):
        weights[ray] = 0.0
        if edges[ray, 2] > 0.0 and abs(off[ray]) < limit:
            weights[ray] = 1.0
            count += 1
            squares += off[ray] * off[ray]
            steps += edges[ray, 1]
    results[k, 5] = count / RAYS if count >= _LEAST_EDGES else 0.0
    results[k, 6] = steps / max(count, 1)
    if count >= _LEAST_EDGES:
        _move(search, results, k, work)
    else:
        for term in range(3, terms):
            fitted[term] = 0.0
    return max(math.sqrt(squares / max(count - terms, 1)), _LEAST_SCATTER_PX)


@inlined
def _write_errors(
    search: Search, results: NDArray[np.float64], k: int, scatter: float, work: Scratch
) -> None:
    """Errors of place and radius of disc `k`, from the scatter of the edges."""
    _sum_up(search.shape, work, 1e-6)
    variance = scatter * scatter * _CORRELATION_FACTOR
    place = 0.5 * (_variance(work, 0) + _variance(work, 1))
    results[k, 3] = math.sqrt(variance * place)
    results[k, 4] = math.sqrt(variance * _variance(work, 2))


@inlined
def _move(search: Search, results: NDArray[np.float64], k: int, work: Scratch) -> None:
    """Move disc `k` to what was fitted."""
    fitted = work.fitted
    most = 0.5 * results[k, 2]
    for axis in range(2):
        results[k, axis] += min(max(fitted[axis], -most), most)
    results[k, 2] = min(max(fitted[2], 0.8 * search.smallest), 1.25 * search.largest)
    if len(fitted) > 3:
        results[k, 8] = _longest_gap(work.weights) / RAYS
        results[k, 7] = math.sqrt(fitted[3] * fitted[3] + fitted[4] * fitted[4])


@inlined
def _longest_gap(weights: NDArray[np.float64]) -> int:
    """Most successive rays without an edge on the outline, all around."""
    gap, longest = 0, 0
    for turn in range(2 * RAYS):
        gap = 0 if weights[turn % RAYS] > 0.0 else gap + 1
        longest = max(longest, gap)
    return min(longest, RAYS)


@inlined
def _sum_up(shape: NDArray[np.float64], work: Scratch, ridge: float) -> None:
    """Normal equations of the edges: those of the circle in registers, smear in arrays."""
    normal, right = work.normal, work.right
    terms = len(right)
    for i in range(3, terms):
        right[i] = 0.0
        for j in range(i + 1):
            normal[i, j] = ridge if i == j else 0.0
    xx, yx, yy, x, y, count = ridge, 0.0, ridge, 0.0, 0.0, ridge
    right_x, right_y, right_radius = 0.0, 0.0, 0.0
    for ray in range(RAYS):
        weight = work.weights[ray]
        if not weight > 0.0:
            continue
        across, down, distance = shape[ray, 0], shape[ray, 1], work.edges[ray, 0]
        part_x, part_y = weight * across, weight * down
        part_radius = weight * shape[ray, 2]
        xx += part_x * across
        yx += part_y * across
        yy += part_y * down
        x += part_radius * across
        y += part_radius * down
        count += part_radius * shape[ray, 2]
        right_x += part_x * distance
        right_y += part_y * distance
        right_radius += part_radius * distance
        for i in range(3, terms):
            part = weight * shape[ray, i]
            right[i] += part * distance
            for j in range(i + 1):
                normal[i, j] += part * shape[ray, j]
    normal[0, 0], normal[1, 0], normal[1, 1] = xx, yx, yy
    normal[2, 0], normal[2, 1], normal[2, 2] = x, y, count
    right[0], right[1], right[2] = right_x, right_y, right_radius
    for i in range(terms):
        for j in range(i):
            normal[j, i] = normal[i, j]


@inlined
def _solve(normal: NDArray[np.float64], work: Scratch) -> None:
    """Solve the normal equations for `fitted`, by elimination."""
    terms = len(work.right)
    for i in range(terms):
        work.fitted[i] = work.right[i]
        for j in range(terms):
            work.matrix[i, j] = normal[i, j]
    eliminate(work.matrix, work.fitted)


@inlined
def _variance(work: Scratch, k: int) -> float:
    """Element of the diagonal of the inverse of the normal equations."""
    terms = len(work.right)
    for i in range(terms):
        work.right[i] = 1.0 if i == k else 0.0
        for j in range(terms):
            work.matrix[i, j] = work.normal[i, j]
    eliminate(work.matrix, work.right)
    return float(max(work.right[k], 0.0))
