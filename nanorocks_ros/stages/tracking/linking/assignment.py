"""Linear assignment of detections to tracks at the lowest total cost."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


class _Pairing(NamedTuple):
    """State of the assignment, with dual prices and the search for the next augmenting path.

    `distance`, `reached_from` and `settled` are of columns, `touched` lists the columns with a
    distance, `visited` the rows on the path, with their `row_distance`.
    """

    column_of_row: NDArray[np.int64]
    row_of_column: NDArray[np.int64]
    row_price: NDArray[np.float64]
    column_price: NDArray[np.float64]
    distance: NDArray[np.float64]
    reached_from: NDArray[np.int64]
    settled: NDArray[np.bool_]
    touched: NDArray[np.int64]
    row_distance: NDArray[np.float64]
    visited: NDArray[np.int64]


class Costs(NamedTuple):
    """Sparse cost matrix in compressed rows.

    Parameters
    ----------
    starts : ndarray of int64, (n + 1,)
        Start of each row in the other arrays.
    columns : ndarray of int64, (pairs,)
        Ascending within a row.
    values : ndarray (pairs,)
    """

    starts: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: NDArray[np.float64]


@compiled
def assign(costs: Costs, columns: int, unlinked_cost: float) -> NDArray[np.int64]:
    """Assign rows to columns, or leave rows unassigned, at the lowest total cost.

    Parameters
    ----------
    costs : Costs
    columns : int
        Number of columns.
    unlinked_cost : float
        Cost of an unassigned row.

    Returns
    -------
    ndarray of int64, (n,)
        Column of each row, or -1.

    References
    ----------
    Shortest augmenting paths: Jonker and Volgenant (1987), Computing 38, 325.
    """
    n, m = costs.starts.size - 1, columns
    state = _Pairing(
        np.full(n, -1, dtype=np.int64),
        np.full(m, -1, dtype=np.int64),
        np.zeros(n),
        np.zeros(m),
        np.full(m, np.inf),
        np.empty(m, dtype=np.int64),
        np.zeros(m, dtype=np.bool_),
        np.empty(m, dtype=np.int64),
        np.empty(n),
        np.empty(n, dtype=np.int64),
    )
    _add_rows(costs, unlinked_cost, state)
    return state.column_of_row


@kernel
def _add_rows(costs: Costs, unlinked_cost: float, state: _Pairing) -> None:
    for start in range(state.column_of_row.size):
        _add_row(costs, unlinked_cost, state, start)


@kernel
def _add_row(
    costs: Costs,
    unlinked_cost: float,
    state: _Pairing,
    start: int,
) -> None:
    """Add a row along the augmenting path of lowest cost."""
    reached, visits = 0, 1
    state.visited[0] = start
    state.row_distance[start] = 0.0
    row, end_column = start, -1
    end_row, end_distance = start, unlinked_cost - state.row_price[start]
    while True:
        reached = _relax_from(costs, state, row, reached)
        nearest, nearest_distance = _nearest_column(state, reached, end_distance)
        if nearest < 0:
            break
        state.settled[nearest] = True
        if state.row_of_column[nearest] < 0:
            end_column, end_distance = nearest, nearest_distance
            break
        row = state.row_of_column[nearest]
        state.row_distance[row] = nearest_distance
        state.visited[visits] = row
        visits += 1
        unlinked_distance = nearest_distance + unlinked_cost - state.row_price[row]
        if unlinked_distance < end_distance:
            end_row, end_distance = row, unlinked_distance
    _update_prices(state, visits, reached, end_distance)
    # Go back along the path: each row passes its column to the row before.
    column = end_column
    if column < 0:
        column = state.column_of_row[end_row]
        state.column_of_row[end_row] = -1
    while column >= 0:
        row = state.reached_from[column]
        before = state.column_of_row[row]
        state.column_of_row[row] = column
        state.row_of_column[column] = row
        column = before


@kernel
def _relax_from(
    costs: Costs,
    state: _Pairing,
    row: int,
    reached: int,
) -> int:
    """Relax the distances of the columns of a row; return the number of touched columns."""
    for k in range(costs.starts[row], costs.starts[row + 1]):
        j = costs.columns[k]
        if state.settled[j]:
            continue
        reduced = costs.values[k] - state.row_price[row] - state.column_price[j]
        if state.row_distance[row] + reduced < state.distance[j]:
            if state.distance[j] == np.inf:
                state.touched[reached] = j
                reached += 1
            state.distance[j] = state.row_distance[row] + reduced
            state.reached_from[j] = row
    return reached


@kernel
def _nearest_column(state: _Pairing, reached: int, limit: float) -> tuple[int, float]:
    nearest, distance = -1, limit
    for k in range(reached):
        j = state.touched[k]
        if not state.settled[j] and state.distance[j] < distance:
            nearest, distance = j, state.distance[j]
    return nearest, distance


@kernel
def _update_prices(state: _Pairing, visits: int, reached: int, end: float) -> None:
    """Update the prices so that reduced costs stay positive, and clear the search."""
    for k in range(visits):
        row = state.visited[k]
        state.row_price[row] += end - state.row_distance[row]
    for k in range(reached):
        j = state.touched[k]
        if state.settled[j]:
            state.column_price[j] -= end - min(state.distance[j], end)
        state.distance[j] = np.inf
        state.settled[j] = False
