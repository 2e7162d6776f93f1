"""Random numbers: known values, uniform, and independent of the order of the calls."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.counter_rng import (
    Purpose,
    direction,
    hashed,
    key_for,
    nearly_normal,
    uniform,
)

KEY = np.uint64(1234567)
GOLDEN_KEY = 4674145027382489245


def test_the_hash_is_splitmix64():
    # First outputs of the reference implementation for the seed 1234567.
    expected = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert [int(hashed(KEY, k)) for k in range(3)] == expected


def test_keys_differ_by_seed_run_and_purpose_and_never_change():
    keys = {
        int(key_for(seed, run, purpose))
        for seed in range(5)
        for run in range(5)
        for purpose in Purpose
    }
    assert len(keys) == 5 * 5 * len(Purpose)
    assert int(key_for(1, 0, Purpose.VELOCITIES)) == GOLDEN_KEY


def test_uniform_numbers_are_even_in_zero_to_one():
    values = np.array([uniform(KEY, k) for k in range(20_000)])
    assert values.min() >= 0.0
    assert values.max() < 1.0
    assert values.mean() == pytest.approx(0.5, abs=4 / np.sqrt(12 * values.size))
    counts, _ = np.histogram(values, 20, (0, 1))
    assert np.sum((counts - 1000.0) ** 2 / 1000.0) < 50.0


def test_nearly_normal_numbers_have_unit_deviation():
    values = np.array([nearly_normal(KEY, k) for k in range(40_000)])
    assert values.mean() == pytest.approx(0.0, abs=0.02)
    assert values.std() == pytest.approx(1.0, abs=0.015)
    assert np.mean(np.abs(values) < 1.0) == pytest.approx(0.683, abs=0.012)


def test_directions_are_unit_vectors_even_over_the_sphere():
    vectors = np.array([direction(np.uint64(hashed(KEY, k))) for k in range(20_000)])
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-14)
    assert np.abs(vectors.mean(axis=0)).max() < 4 / np.sqrt(3 * 20_000)
    np.testing.assert_allclose(vectors.T @ vectors / 20_000, np.eye(3) / 3, atol=0.01)


@pytest.mark.parametrize(('seed', 'run'), [(-1, 0), (0, -1)])
def test_negative_seeds_are_refused(seed, run):
    with pytest.raises(SimulationError, match='give whole numbers from 0'):
        key_for(seed, run, Purpose.NOISE)
