"""The pairing of least cost, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from nanorocks_ros.stages.tracking.linking.assignment import Costs, assign


def _assigned(costs, alone):
    """Of a matrix of costs, infinite where a pair is not possible."""
    possible = np.isfinite(costs)
    starts = np.concatenate([[0], np.cumsum(possible.sum(axis=1))]).astype(np.int64)
    columns = np.nonzero(possible)[1].astype(np.int64)
    return assign(Costs(starts, columns, costs[possible]), costs.shape[1], alone)


def _total(costs, partner, alone):
    return sum(costs[i, j] if j >= 0 else alone for i, j in enumerate(partner))


@pytest.mark.parametrize('seed', range(8))
def test_the_total_cost_is_the_least_with_rows_that_may_stay_alone(seed):
    rng = np.random.default_rng(seed)
    for _ in range(40):
        n, m = rng.integers(1, 12, 2)
        costs = rng.uniform(0.0, 10.0, (n, m))
        costs[rng.random((n, m)) < 0.4] = np.inf
        alone = rng.uniform(1.0, 12.0)
        partner = _assigned(costs, alone)
        taken = partner[partner >= 0]
        assert np.unique(taken).size == taken.size
        large = np.full((n, m + n), 1e9)
        large[:, :m] = np.minimum(costs, 1e9)
        large[np.arange(n), m + np.arange(n)] = alone
        rows, columns = linear_sum_assignment(large)
        assert _total(costs, partner, alone) == pytest.approx(large[rows, columns].sum())


def test_nothing_to_pair_is_no_error():
    assert _assigned(np.empty((0, 3)), 1.0).size == 0
    assert _assigned(np.empty((2, 0)), 1.0).tolist() == [-1, -1]
