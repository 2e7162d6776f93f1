"""Mixtures of normal distributions: their number, means and shares, beside strays."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.numerics.gaussian_mixture import fit_mixture, likeliest_mixture

TRUE = (2.0, 2.2, 3.0)


def drawn(count=300, strays=10):
    rng = np.random.default_rng(4)
    parts = [
        mean + rng.normal(0.0, 0.02, size)
        for mean, size in zip(TRUE, (1, 2, 3), strict=True)
        for size in (size * count // 6,)
    ]
    return np.concatenate([*parts, rng.uniform(1.5, 3.5, strays)])


def test_means_deviations_and_shares_are_those_that_were_drawn():
    mixture = fit_mixture(drawn(), 3, 0.005, 300)
    assert mixture.means == pytest.approx(TRUE, abs=0.01)
    assert mixture.deviations == pytest.approx([0.02] * 3, rel=0.3)
    assert mixture.shares == pytest.approx([0.16, 0.32, 0.48], abs=0.03)
    assert mixture.shares.sum() < 1.0


@pytest.mark.parametrize(
    ('kept', 'count'), [(slice(0, 50), 1), (slice(0, 150), 2), (slice(None), 3)]
)
def test_as_many_are_found_as_there_are(kept, count):
    values = drawn(strays=0)[kept]
    assert len(likeliest_mixture(values, 5, 0.005, len(values)).means) == count


def test_values_of_few_independent_ones_tell_less():
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.normal(0.0, 1.0, 200), rng.normal(3.5, 1.0, 200)])
    assert len(likeliest_mixture(values, 3, 0.1, 400).means) == 2
    assert len(likeliest_mixture(values, 3, 0.1, 4).means) == 1


def test_equal_values_are_one_distribution():
    mixture = likeliest_mixture(np.full(40, 2.5), 3, 0.01, 40)
    assert mixture.means == pytest.approx([2.5])
    assert mixture.deviations == pytest.approx([0.01])


def test_fewer_values_than_distributions_are_refused():
    with pytest.raises(ValueError, match='1 values for 2'):
        fit_mixture(np.ones(1), 2, 0.1, 1)
