"""The compiled sort gives the order of numpy's stable sort."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.numerics.stable_sort import stable_argsort


@pytest.mark.parametrize('size', [0, 1, 2, 5, 64, 1001])
def test_the_order_is_that_of_a_stable_sort(size):
    # Few different values, so that many are equal.
    values = np.random.default_rng(size).integers(0, 9, size).astype(np.float64)
    np.testing.assert_array_equal(stable_argsort(values), np.argsort(values, kind='stable'))


def test_unknown_numbers_come_last():
    values = np.array([np.nan, 2.0, np.inf, np.nan, -1.0, 2.0])
    np.testing.assert_array_equal(stable_argsort(values), np.argsort(values, kind='stable'))


def test_integers_are_sorted_as_well():
    values = np.array([3, -1, 3, 0, 2], dtype=np.int32)
    np.testing.assert_array_equal(stable_argsort(values), np.argsort(values, kind='stable'))
