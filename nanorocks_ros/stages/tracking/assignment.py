"""Which detection belongs to which track: the pairing of least total cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray


@compiled
def _possible(costs: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns that each row may be paired with, one row after the other, and where it starts."""
    n, m = costs.shape
    starts = np.zeros(n + 1, dtype=np.int64)
    for i in range(n):
        total = 0
        for j in range(m):
            total += costs[i, j] < np.inf
        starts[i + 1] = starts[i] + total
    columns = np.empty(starts[n], dtype=np.int64)
    for i in range(n):
        place = starts[i]
        for j in range(m):
            if costs[i, j] < np.inf:
                columns[place] = j
                place += 1
    return starts, columns


@compiled
def assign(costs: NDArray[np.float64], alone: float) -> NDArray[np.int64]:
    """Pair rows with columns, or leave them alone, at the least total cost.

    Parameters
    ----------
    costs : ndarray (n, m)
        Infinite where a pair is not possible.
    alone : float
        Cost of a row without a column.

    Returns
    -------
    ndarray of int64, (n,)
        Column of each row, or -1.

    References
    ----------
    Shortest augmenting paths: Jonker and Volgenant (1987), Computing 38, 325.
    """
    n, m = costs.shape
    starts, columns = _possible(costs)
    partner = np.full(n, -1, dtype=np.int64)
    owner = np.full(m, -1, dtype=np.int64)
    row_price = np.zeros(n)
    column_price = np.zeros(m)
    distance = np.full(m, np.inf)
    reached_from = np.empty(m, dtype=np.int64)
    done = np.zeros(m, dtype=np.bool_)
    # Columns reached from the present row, and rows that were given up on the way.
    touched = np.empty(m, dtype=np.int64)
    row_distance = np.empty(n)
    visited = np.empty(n, dtype=np.int64)
    for start in range(n):
        reached = 0
        visited[0], visits = start, 1
        row_distance[start] = 0.0
        row, end_column = start, -1
        end_row, end_distance = start, alone - row_price[start]
        while True:
            for k in range(starts[row], starts[row + 1]):
                j = columns[k]
                if not done[j]:
                    reduced = costs[row, j] - row_price[row] - column_price[j]
                    if row_distance[row] + reduced < distance[j]:
                        if distance[j] == np.inf:
                            touched[reached] = j
                            reached += 1
                        distance[j] = row_distance[row] + reduced
                        reached_from[j] = row
            nearest, nearest_distance = -1, end_distance
            for k in range(reached):
                j = touched[k]
                if not done[j] and distance[j] < nearest_distance:
                    nearest, nearest_distance = j, distance[j]
            if nearest < 0:
                break
            done[nearest] = True
            if owner[nearest] < 0:
                end_column, end_distance = nearest, nearest_distance
                break
            row = owner[nearest]
            row_distance[row] = nearest_distance
            visited[visits] = row
            visits += 1
            if nearest_distance + alone - row_price[row] < end_distance:
                end_row, end_distance = row, nearest_distance + alone - row_price[row]
        for k in range(visits):
            row_price[visited[k]] += end_distance - row_distance[visited[k]]
        for k in range(reached):
            j = touched[k]
            if done[j]:
                column_price[j] -= end_distance - min(distance[j], end_distance)
            distance[j] = np.inf
            done[j] = False
        # Go back from the end of the path, every row giving up its column to the one before.
        if end_column >= 0:
            column = end_column
        else:
            column = partner[end_row]
            partner[end_row] = -1
        while column >= 0:
            row = reached_from[column]
            before = partner[row]
            partner[row] = column
            owner[column] = row
            column = before
    return partner
