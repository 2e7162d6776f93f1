"""Votes for discs, discs that lie on better ones, and colours of circles around discs, compiled.

Tested by ``test/stages/tracking/scene/outlines/test_disc_measures.py`` and ``test_edge_votes.py``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import inlined, kernel


@kernel
def add_votes(
    across: NDArray[np.float32],
    down: NDArray[np.float32],
    size: NDArray[np.float32],
    radii: NDArray[np.float32],
    limits: tuple[np.float32, np.float32, np.float32],
    votes: NDArray[np.float32],
) -> None:
    """Add the votes of each edge for the places at these distances along its gradient.

    Parameters
    ----------
    across, down, size : ndarrays (rows, columns)
        The gradient and its length.
    radii : ndarray (n,), [px]
        Negative: against the gradient.
    limits : tuple of 3 floats
        Smallest gradient of an edge, largest that counts, and votes for a unit of it.
    votes : ndarray (rows, columns)
        Changed.
    """
    rows, columns = votes.shape
    least, most, unit = limits
    half = np.float32(0.5)
    for i in range(rows):
        for j in range(columns):
            length = size[i, j]
            if not length > least:
                continue
            weight = min(length, most) * unit
            right, below = across[i, j] / length, down[i, j] / length
            for k in range(len(radii)):
                x = np.float32(j) + radii[k] * right + half
                y = np.float32(i) + radii[k] * below + half
                # Conversion to integers cuts towards 0.
                if x >= half and y >= half:
                    column, row = int(x), int(y)
                    if column < columns and row < rows:
                        votes[row, column] += weight


@kernel
def find_peaks(
    votes: NDArray[np.float32],
    near: NDArray[np.int64],
    least: np.float32,
    peaks: NDArray[np.float64],
) -> int:
    """Write places that have at least as many votes as all near ones.

    Parameters
    ----------
    votes : ndarray (rows, columns)
    near : ndarray (n, 2)
        Rows and columns from a place to those near.
    least : float
    peaks : ndarray (m, 3)
        Written: column, row, votes.

    Returns
    -------
    int
        Number of peaks; not more than there is room for.
    """
    rows, columns = votes.shape
    count = 0
    for i in range(rows):
        for j in range(columns):
            own = votes[i, j]
            if not own > least or count == len(peaks):
                continue
            largest = True
            for k in range(len(near)):
                row, column = i + near[k, 0], j + near[k, 1]
                if 0 <= row < rows and 0 <= column < columns and votes[row, column] > own:
                    largest = False
                    break
            if largest:
                peaks[count, 0], peaks[count, 1], peaks[count, 2] = j, i, own
                count += 1
    return count


@kernel
def leave_out_near(
    discs: NDArray[np.float64],
    order: NDArray[np.intp],
    radii: float,
    keep: NDArray[np.bool_],
) -> None:
    """Leave out discs whose centres lie within so many radii of that of a better one.

    Parameters
    ----------
    discs : ndarray (n, 3)
        Column, row, radius.
    order : ndarray (n,)
        The best first.
    radii : float
    keep : ndarray (n,)
        Changed to false for those left out.
    """
    for i in range(len(order)):
        k = order[i]
        if not keep[k]:
            continue
        reach = (radii * discs[k, 2]) ** 2
        for j in range(i + 1, len(order)):
            other = order[j]
            x, y = discs[other, 0] - discs[k, 0], discs[other, 1] - discs[k, 1]
            if x * x + y * y <= reach:
                keep[other] = False


@kernel
def ring_medians(
    color: NDArray[np.uint8],
    discs: NDArray[np.float64],
    places: NDArray[np.float64],
    values: NDArray[np.uint8],
    medians: NDArray[np.float64],
) -> None:
    """Median of each colour at places around discs.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3)
    discs : ndarray (n, 3)
        Column, row, radius.
    places : ndarray (m, 2)
        From the centre, in radii: across and down.
    values : ndarray of uint8, (3, m)
        Overwritten.
    medians : ndarray (n, 3)
        Written.
    """
    rows, columns = color.shape[0] - 1.0, color.shape[1] - 1.0
    count = len(places)
    for k in range(len(discs)):
        for i in range(count):
            x = np.rint(discs[k, 0] + discs[k, 2] * places[i, 0])
            y = np.rint(discs[k, 1] + discs[k, 2] * places[i, 1])
            # NaN counts as 0.
            column = int(min(x, columns)) if x > 0.0 else 0
            row = int(min(y, rows)) if y > 0.0 else 0
            for channel in range(3):
                values[channel, i] = color[row, column, channel]
        for channel in range(3):
            medians[k, channel] = _median(values[channel])


@inlined
def _median(values: NDArray[np.uint8]) -> float:
    """Median of a few values, by their bits: sorting takes longer."""
    count = len(values)
    lower = np.uint8(0)
    for bit in range(8):
        least = np.uint8(lower | np.uint8(128 >> bit))
        below = 0
        for i in range(count):
            below += values[i] < least
        if below <= (count - 1) // 2:
            lower = least
    # The next one, of an even number.
    upper, not_above = np.uint8(255), 0
    for i in range(count):
        not_above += values[i] <= lower
        upper = min(upper, values[i]) if values[i] > lower else upper
    if not_above > count // 2:
        upper = lower
    return 0.5 * (float(lower) + float(upper))


@kernel
def have_near(
    features: NDArray[np.float64],
    known: NDArray[np.float64],
    limits: NDArray[np.float64],
    count: int,
    near: NDArray[np.bool_],
) -> None:
    """Find features with at least so many known ones nearer than a limit.

    Parameters
    ----------
    features, known : ndarrays (n, d) and (m, d)
    limits : ndarray (n,)
    count : int
    near : ndarray (n,)
        Written.
    """
    for i in range(len(features)):
        found = 0
        for k in range(len(known)):
            square = 0.0
            for j in range(known.shape[1]):
                off = features[i, j] - known[k, j]
                square += off * off
            if square < limits[i] * limits[i]:
                found += 1
                if found >= count:
                    break
        near[i] = found >= count
