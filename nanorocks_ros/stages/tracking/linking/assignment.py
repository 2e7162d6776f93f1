"""Which detection belongs to which track: the pairing of least total cost."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


class _Pairing(NamedTuple):
    """Who is paired with whom, prices, and the search for the next pair.

    `distance`, `reached_from` and `done` are of columns, `touched` lists those with a distance,
    `visited` the rows on the way, with their `row_distance`.
    """

    partner: NDArray[np.int64]
    owner: NDArray[np.int64]
    row_price: NDArray[np.float64]
    column_price: NDArray[np.float64]
    distance: NDArray[np.float64]
    reached_from: NDArray[np.int64]
    done: NDArray[np.bool_]
    touched: NDArray[np.int64]
    row_distance: NDArray[np.float64]
    visited: NDArray[np.int64]


class Costs(NamedTuple):
    """Costs of the pairs that are possible.

    Parameters
    ----------
    starts : ndarray of int64, (n + 1,)
        Where the pairs of each row begin in the others.
    columns : ndarray of int64, (pairs,)
        Rising within a row.
    values : ndarray (pairs,)
    """

    starts: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: NDArray[np.float64]


@compiled
def assign(costs: Costs, columns: int, alone: float) -> NDArray[np.int64]:
    """Pair rows with columns, or leave them alone, at the least total cost.

    Parameters
    ----------
    costs : Costs
    columns : int
        How many there are.
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
    _add_rows(costs, alone, state)
    return state.partner


@kernel
def _add_rows(costs: Costs, alone: float, state: _Pairing) -> None:
    for start in range(state.partner.size):
        _add_row(costs, alone, state, start)


@kernel
def _add_row(
    costs: Costs,
    alone: float,
    state: _Pairing,
    start: int,
) -> None:
    """Pair one more row, along the path of least cost by which others make room for it."""
    reached, visits = 0, 1
    state.visited[0] = start
    state.row_distance[start] = 0.0
    row, end_column = start, -1
    end_row, end_distance = start, alone - state.row_price[start]
    while True:
        reached = _reach_from(costs, state, row, reached)
        nearest, nearest_distance = _nearest(state, reached, end_distance)
        if nearest < 0:
            break
        state.done[nearest] = True
        if state.owner[nearest] < 0:
            end_column, end_distance = nearest, nearest_distance
            break
        row = state.owner[nearest]
        state.row_distance[row] = nearest_distance
        state.visited[visits] = row
        visits += 1
        given_up = nearest_distance + alone - state.row_price[row]
        if given_up < end_distance:
            end_row, end_distance = row, given_up
    _settle_prices(state, visits, reached, end_distance)
    # Go back from the end of the path, every row giving up its column to the one before.
    column = end_column
    if column < 0:
        column = state.partner[end_row]
        state.partner[end_row] = -1
    while column >= 0:
        row = state.reached_from[column]
        before = state.partner[row]
        state.partner[row] = column
        state.owner[column] = row
        column = before


@kernel
def _reach_from(
    costs: Costs,
    state: _Pairing,
    row: int,
    reached: int,
) -> int:
    """Update the distances of the columns that a row may be paired with; how many have one."""
    for k in range(costs.starts[row], costs.starts[row + 1]):
        j = costs.columns[k]
        if state.done[j]:
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
def _nearest(state: _Pairing, reached: int, limit: float) -> tuple[int, float]:
    nearest, distance = -1, limit
    for k in range(reached):
        j = state.touched[k]
        if not state.done[j] and state.distance[j] < distance:
            nearest, distance = j, state.distance[j]
    return nearest, distance


@kernel
def _settle_prices(state: _Pairing, visits: int, reached: int, end: float) -> None:
    """Keep all reduced costs positive, and make ready for the next row."""
    for k in range(visits):
        row = state.visited[k]
        state.row_price[row] += end - state.row_distance[row]
    for k in range(reached):
        j = state.touched[k]
        if state.done[j]:
            state.column_price[j] -= end - min(state.distance[j], end)
        state.distance[j] = np.inf
        state.done[j] = False
