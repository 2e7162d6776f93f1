"""Restitutions from contacts drawn from the likelihoods."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_collisions, drawn_rebound, drawn_rebounds

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.contacts.contact_estimate import contact_estimate
from nanorocks_ros.inference.contacts.contact_likelihood import (
    pair_log_likelihood,
    pair_table,
    rebound_log_likelihood,
)
from nanorocks_ros.inference.contacts.projected_collisions import RadiusExcess

WALLS = np.linspace(0.6, 1.0, 161)
PAIRS = np.linspace(0.4, 1.0, 121)


def _walls(rebounds):
    return contact_estimate(WALLS, rebound_log_likelihood(list(rebounds), WALLS))


def test_rebounds_give_the_restitution_of_the_wall_without_bias():
    rng = np.random.default_rng(1)
    estimates = [_walls(drawn_rebounds(rng, 30, 0.85)) for _ in range(60)]
    values = np.array([estimate.restitution for estimate in estimates])
    assert values.mean() == pytest.approx(0.85, abs=3.5 * values.std() / 60**0.5)
    # Stated errors are not believed altogether.
    stated = np.mean([estimate.restitution_error for estimate in estimates])
    assert 1.0 < stated / values.std() < 1.8


def test_outliers_among_rebounds_have_little_effect():
    rng = np.random.default_rng(2)
    rebounds = list(drawn_rebounds(rng, 40, 0.9, 0.02))
    clean = _walls(rebounds)
    spoilt = _walls(
        [*rebounds, drawn_rebound(3e-3, 0.5e-3, 6e-5), drawn_rebound(2e-3, 4e-3, 6e-5)]
    )
    assert spoilt.restitution == pytest.approx(
        clean.restitution, abs=0.5 * clean.restitution_error
    )


def test_an_uncertain_wall_velocity_enlarges_the_error():
    still = _walls([drawn_rebound(3e-3, 2.7e-3, 3e-5)])
    moving = _walls([drawn_rebound(3e-3, 2.7e-3, 3e-5, wall_error=1e-4)])
    assert moving.restitution == pytest.approx(still.restitution, abs=0.01)
    assert moving.restitution_error > 1.5 * still.restitution_error


def test_two_cycles_add_up():
    rng = np.random.default_rng(3)
    cycles = [list(drawn_rebounds(rng, 20, 0.9)) for _ in range(2)]
    logs = [rebound_log_likelihood(cycle, WALLS) for cycle in cycles]
    combined = contact_estimate(WALLS, sum(logs))
    assert combined.restitution_error < min(_walls(cycle).restitution_error for cycle in cycles)


def _pairs(collisions, **values):
    return contact_estimate(PAIRS, pair_log_likelihood(collisions, PAIRS, **values))


@pytest.mark.parametrize('restitution', [0.6, 0.9])
@pytest.mark.parametrize('ratio', [0.3, 1.0])
def test_collisions_give_the_restitution_at_any_ratio_of_vertical_speeds(restitution, ratio):
    estimate = _pairs(drawn_collisions(4, 250, restitution, ratio=ratio))
    assert estimate.restitution_error < 0.02
    assert estimate.restitution == pytest.approx(restitution, abs=3.0 * estimate.restitution_error)


def test_intervals_from_collisions_have_the_stated_coverage():
    estimates = [_pairs(drawn_collisions(seed, 30, 0.8, ratio=0.6)) for seed in range(50)]
    covered = np.mean([estimate.lower <= 0.8 <= estimate.upper for estimate in estimates])
    assert 0.55 < covered < 0.9


def test_errors_that_are_stated_too_small_widen_the_interval():
    collisions = drawn_collisions(12, 60, 0.8)
    sure = [
        replace(
            collision,
            before_errors=0.5 * collision.before_errors,
            after_errors=0.5 * collision.after_errors,
        )
        for collision in collisions
    ]
    wide, narrow = (_pairs(some).restitution_error for some in (collisions, sure))
    assert narrow > 0.8 * wide


def test_tables_of_parts_add_up():
    collisions = drawn_collisions(8, 150, 0.8)
    parts = [pair_table(part, PAIRS) for part in (collisions[:70], collisions[70:])]
    assert pair_table(collisions, PAIRS) == pytest.approx(sum(parts))


def test_known_vertical_speeds_reduce_the_error():
    collisions = drawn_collisions(5, 80, 0.8, ratio=0.6)
    known = _pairs(collisions, vertical_ratios=(0.6,))
    assert known.restitution_error <= _pairs(collisions).restitution_error * 1.05


def test_radii_measured_too_large_do_not_bias_the_restitution():
    collisions = drawn_collisions(6, 150, 0.8, radius_error=0.04)
    believed = _pairs(collisions, excesses=(RadiusExcess(0.0, 0.0),))
    doubted = _pairs(collisions)
    assert abs(doubted.restitution - 0.8) < 3.0 * doubted.restitution_error
    assert abs(doubted.restitution - 0.8) < 0.5 * abs(believed.restitution - 0.8)


def test_distances_tell_that_known_radii_show_larger():
    exact = drawn_collisions(9, 60, 0.8)
    larger = [replace(collision, radii=1.0075 * collision.radii) for collision in exact]
    believed = _pairs(larger, excesses=(RadiusExcess(0.0, 0.0),))
    told, true = _pairs(larger), _pairs(exact)
    assert told.restitution == pytest.approx(true.restitution, abs=0.2 * true.restitution_error)
    assert told.restitution_error < 1.05 * true.restitution_error
    assert believed.restitution_error > 1.1 * true.restitution_error


def test_missing_collisions_below_the_sticking_speed_do_not_bias_the_restitution():
    collisions = drawn_collisions(7, 250, 0.8, ratio=1.0, sticking_speed=0.8e-3)
    ignored = _pairs(collisions)
    known = _pairs(collisions, sticking_speed=0.8e-3)
    assert known.restitution == pytest.approx(0.8, abs=3.0 * known.restitution_error)
    assert abs(known.restitution - 0.8) < abs(ignored.restitution - 0.8)


@pytest.mark.parametrize('likelihood', [rebound_log_likelihood, pair_log_likelihood])
def test_no_contacts_give_a_constant_likelihood_and_no_estimate(likelihood):
    assert likelihood([], WALLS).tolist() == [0.0] * WALLS.size
    with pytest.raises(FitError, match='a constant or infinite log likelihood'):
        contact_estimate(WALLS, likelihood([], WALLS))


@pytest.mark.parametrize('likelihood', [rebound_log_likelihood, pair_log_likelihood])
@pytest.mark.parametrize('grid', [[0.5, 1.2], [-0.1], [], [math.nan], [[0.5]]])
def test_a_grid_that_leaves_0_to_1_is_refused(likelihood, grid):
    with pytest.raises(FitError, match='correct the grid'):
        likelihood([], grid)


@pytest.mark.parametrize('share', [0.0, 1.0, math.nan])
def test_a_fraction_of_outliers_outside_0_to_1_is_refused(share):
    with pytest.raises(FitError, match='outliers'):
        rebound_log_likelihood([], WALLS, outliers=share)


def test_an_estimate_finds_a_peak_between_the_nodes():
    logs = -0.5 * ((WALLS - 0.8013) / 0.004) ** 2
    estimate = contact_estimate(WALLS, logs)
    assert estimate.restitution == pytest.approx(0.8013, abs=2e-4)
    assert estimate.restitution_error == pytest.approx(0.004, rel=0.02)
    assert estimate.upper - estimate.lower == pytest.approx(2.0 * 0.004 * 0.9945, rel=0.02)
