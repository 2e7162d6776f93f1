"""Collisions of beads that stick when slow tell restitution and sticking speed together."""

from __future__ import annotations

import numpy as np
import pytest
from contact_draws import drawn_collisions

from nanorocks_ros.inference.contacts.contact_likelihood import marginal, pair_table
from nanorocks_ros.inference.contacts.contact_terms import BEADS
from nanorocks_ros.inference.sticking.bounce_tables import (
    SPEEDS,
    BounceTables,
    RunningBounces,
    node_weights,
)

STICKING = 1.5e-3


@pytest.fixture(scope='module')
def collisions():
    return list(drawn_collisions(7, 60, 0.85, sticking_speed=STICKING))


@pytest.fixture(scope='module')
def tables(collisions):
    return BounceTables.of(collisions)


def test_where_nothing_sticks_the_table_is_that_of_all_collisions(collisions, tables):
    never = np.zeros(SPEEDS.size)
    never[0] = 1.0
    assert tables.collisions == len(collisions)
    np.testing.assert_allclose(tables.bead_table(never), pair_table(collisions, BEADS), atol=1e-9)


def test_the_slowest_collisions_limit_the_sticking_speed_from_above(tables):
    logs = tables.speed_log_likelihood()
    best = SPEEDS[np.argmax(logs)]
    assert best == pytest.approx(STICKING, rel=0.2)
    assert np.interp(1.4 * STICKING, SPEEDS, logs) < logs.max() - 4.0
    # Without slow collisions a low sticking speed is improbable, too.
    assert np.interp(0.3 * STICKING, SPEEDS, logs) < logs.max() - 2.0


def test_the_restitution_lies_where_the_merges_put_the_sticking_speed(tables):
    weights = node_weights(SPEEDS, -0.5 * ((SPEEDS - STICKING) / (0.2 * STICKING)) ** 2)
    log_likelihood = marginal(tables.bead_table(weights))
    probability = np.exp(log_likelihood - log_likelihood.max())
    probability /= probability.sum()
    mean = probability @ BEADS
    spread = np.sqrt(probability @ (BEADS - mean) ** 2)
    assert spread < 0.03
    assert abs(mean - 0.85) < 3.0 * spread


def test_weights_of_nodes_keep_the_mean_of_a_likelihood_between_them():
    speeds = np.linspace(1e-5, 0.03, 5000)
    weights = node_weights(speeds, -0.5 * ((speeds - 4e-3) / 5e-4) ** 2)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ SPEEDS == pytest.approx(4e-3, rel=1e-3)


def test_a_cycle_that_grows_or_loses_collisions_has_the_tables_of_what_is_left(collisions):
    running = RunningBounces()
    for part in (collisions[:3], collisions[:8], [*collisions[:2], *collisions[5:8]]):
        expected = BounceTables.of(part)
        tables = running.of(part)
        assert tables.collisions == len(part)
        np.testing.assert_allclose(tables.logs, expected.logs, atol=1e-9)
