"""Assignment of lowest cost against `scipy.optimize.linear_sum_assignment`."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from nanorocks_ros.stages.tracking.linking.assignment import Costs, assign


def _assign_matrix(costs, unlinked_cost):
    """Assign rows of a cost matrix, infinite where a pair is impossible."""
    possible = np.isfinite(costs)
    starts = np.concatenate([[0], np.cumsum(possible.sum(axis=1))]).astype(np.int64)
    columns = np.nonzero(possible)[1].astype(np.int64)
    return assign(Costs(starts, columns, costs[possible]), costs.shape[1], unlinked_cost)


def _total(costs, columns_of_rows, unlinked_cost):
    return sum(costs[i, j] if j >= 0 else unlinked_cost for i, j in enumerate(columns_of_rows))


@pytest.mark.parametrize('seed', range(8))
def test_the_total_cost_is_the_lowest_with_unassigned_rows(seed):
    rng = np.random.default_rng(seed)
    for _ in range(40):
        n, m = rng.integers(1, 12, 2)
        costs = rng.uniform(0.0, 10.0, (n, m))
        costs[rng.random((n, m)) < 0.4] = np.inf
        unlinked_cost = rng.uniform(1.0, 12.0)
        columns_of_rows = _assign_matrix(costs, unlinked_cost)
        assigned = columns_of_rows[columns_of_rows >= 0]
        assert np.unique(assigned).size == assigned.size
        large = np.full((n, m + n), 1e9)
        large[:, :m] = np.minimum(costs, 1e9)
        large[np.arange(n), m + np.arange(n)] = unlinked_cost
        rows, columns = linear_sum_assignment(large)
        assert _total(costs, columns_of_rows, unlinked_cost) == pytest.approx(
            large[rows, columns].sum()
        )


def test_an_empty_cost_matrix_has_no_assignment():
    assert _assign_matrix(np.empty((0, 3)), 1.0).size == 0
    assert _assign_matrix(np.empty((2, 0)), 1.0).tolist() == [-1, -1]
