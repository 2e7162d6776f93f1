"""Factors of the errors, from collisions drawn with errors that are larger than stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_collisions

from nanorocks_ros.inference.contacts.momentum_balance import (
    MOST_MISSING,
    balance_log_likelihood,
    missing_momentum,
)

SCALES = (1.0, 1.5, 2.25)
OUTLIERS = 0.05


def understated(collisions, factor):
    """Collisions whose errors are that factor of what is stated, as far as they are found."""
    stated = [
        replace(
            collision,
            before_errors=collision.before_errors / factor,
            after_errors=collision.after_errors / factor,
        )
        for collision in collisions
    ]
    return [
        collision for collision in stated if np.hypot(*missing_momentum(collision)) < MOST_MISSING
    ]


@pytest.mark.parametrize('factor', SCALES)
def test_the_most_likely_factor_is_the_true_one(factor):
    collisions = understated(drawn_collisions(8, 60, 0.8), factor)
    logs = balance_log_likelihood(collisions, SCALES, OUTLIERS)
    assert SCALES[np.argmax(logs)] == factor


def test_masses_from_measured_radii_are_no_errors_of_speeds():
    rng = np.random.default_rng(9)
    known = drawn_collisions(9, 60, 0.8)
    wrong = [
        replace(
            collision,
            masses=collision.masses * rng.normal(1.0, 0.06, 2),
            radius_errors=0.02 * collision.radii,
        )
        for collision in known
    ]
    best = SCALES[np.argmax(balance_log_likelihood(wrong, SCALES, OUTLIERS))]
    assert best == 1.0
    told = [replace(collision, radius_errors=np.zeros(2)) for collision in wrong]
    assert SCALES[np.argmax(balance_log_likelihood(told, SCALES, OUTLIERS))] > best


def test_without_collisions_all_factors_are_as_likely():
    assert balance_log_likelihood([], SCALES, OUTLIERS).tolist() == [0.0] * len(SCALES)
