"""Rebounds between floor and lid that rub, against flights that are followed hit by hit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_rebounds

from nanorocks_ros.inference.contacts.contact_likelihood import rebound_log_likelihood
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.contacts.impact_tables import rebound_impacts
from nanorocks_ros.inference.contacts.rubbed_rebounds import SLIDING, rubbed_likelihood
from nanorocks_ros.inference.flights.flight_losses import Slowing
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.records import Measured

FREE_HEIGHT, SPREAD, RESTITUTION = 1e-3, 2e-3, 0.95
RATE, POINTS, JITTER = 30.0, 24, 2e-5
ENDS = np.array([0.025, 0.5, 0.975])
NO_DRAG = Slowing.by_drag(Measured(0.0, 0.0))


def _only(friction):
    return np.array([friction]), np.ones(1)


def _any():
    frictions = np.linspace(0.0, 0.1, 21)
    return frictions, np.full(21, 1.0 / 21.0)


def _positions(rng, friction):
    """Distances from a wall before and after a rebound at time 0, frame by frame."""
    vertical = abs(rng.normal(0.0, SPREAD))
    hit_times = (np.arange(-50, 50) + rng.uniform()) * FREE_HEIGHT / vertical
    step = friction * 1.95 * vertical
    speed = rng.uniform(1.5e-3, 6e-3)
    times = (np.arange(POINTS) + rng.uniform()) / RATE

    def distance(hits, contact, change):
        later = np.clip(times[:, np.newaxis] - hits[hits > 0.0], 0.0, None)
        return contact * times + change * later.sum(axis=1)

    # Seen backwards in time, each hit makes the bead faster.
    before = distance(-hit_times, speed, step)
    return times, before, distance(hit_times, RESTITUTION * speed, -step)


def _rebounds(seed, n, friction):
    """Rebounds as lines through the positions before and after give them."""
    rng = np.random.default_rng(seed)
    error = JITTER * RATE * np.sqrt(12.0 / POINTS**3)
    for rebound in drawn_rebounds(rng, n, RESTITUTION):
        times, before, after = _positions(rng, friction)
        noise = rng.normal(0.0, JITTER, (2, POINTS))
        speeds = [np.polyfit(times, place, 1)[0] for place in np.array([before, after]) + noise]
        middle = float(times.mean())
        yield replace(
            rebound,
            incoming=Measured(float(speeds[0]), error),
            outgoing=Measured(float(speeds[1]), error),
            incoming_drag_time=middle,
            outgoing_drag_time=middle,
            friction_length=2.0 * middle * SPREAD**2 / float(np.mean(speeds)),
            temperature=SPREAD**2,
            free_height=FREE_HEIGHT,
        )


def _quantiles(rebounds, friction, drag=NO_DRAG):
    # These beads do not spin.
    likelihood = rubbed_likelihood(rebound_impacts(list(rebounds)), drag, friction, SLIDING)
    return likelihood.posterior((0.5, 1.0)).quantiles(ENDS)


def test_without_friction_the_likelihood_is_that_of_a_rebound():
    rebounds = list(_rebounds(1, 20, 0.0))
    likelihood = rubbed_likelihood(rebound_impacts(rebounds), NO_DRAG, _only(0.0))
    plain = rebound_log_likelihood(rebounds, likelihood.restitution)
    likely = plain > plain.max() - 15.0
    np.testing.assert_allclose(
        likelihood.log_likelihood[likely] - likelihood.log_likelihood.max(),
        plain[likely] - plain.max(),
        atol=1e-6,
    )


def test_losses_of_floor_and_lid_are_told_from_those_of_the_wall():
    cycles = [list(_rebounds(seed, 40, 0.02)) for seed in range(12)]
    quantiles = np.array([_quantiles(cycle, _any()) for cycle in cycles])
    holds = (quantiles[:, 0] <= RESTITUTION) & (quantiles[:, 2] >= RESTITUTION)
    assert holds.mean() >= 0.75
    assert quantiles[:, 1].mean() == pytest.approx(RESTITUTION, abs=0.004)
    blind = np.array([_quantiles(cycle, _only(0.0)) for cycle in cycles])
    assert blind[:, 1].mean() < RESTITUTION - 0.01


def test_a_known_friction_is_surer_than_an_unknown_one():
    rebounds = list(_rebounds(5, 40, 0.04))
    known, unknown = _quantiles(rebounds, _only(0.04)), _quantiles(rebounds, _any())
    assert known[2] - known[0] < unknown[2] - unknown[0]


@pytest.mark.parametrize(
    'unknown', [{'free_height': 0.0}, {'temperature': math.nan, 'friction_length': math.nan}]
)
def test_beads_that_meet_no_floor_or_of_unknown_speeds_lose_nothing(unknown):
    rebounds = [replace(rebound, **unknown) for rebound in _rebounds(2, 20, 0.0)]
    np.testing.assert_allclose(
        _quantiles(rebounds, _only(0.1)), _quantiles(rebounds, _only(0.0)), atol=1e-9
    )


def test_each_rebound_is_read_at_the_drag_and_with_its_error():
    rebounds = list(_rebounds(3, 30, 0.0))
    taken_out = [dragged(rebound, 0.1 * (k % 2)) for k, rebound in enumerate(rebounds)]
    np.testing.assert_allclose(
        _quantiles(taken_out, _only(0.0)), _quantiles(rebounds, _only(0.0)), atol=5e-4
    )
    low, middle, high = _quantiles(rebounds, _only(0.0), Slowing.by_drag(Measured(0.05, 0.0)))
    shift = 0.05 * 2.0 * 0.5 * POINTS / RATE * RESTITUTION
    assert middle - _quantiles(rebounds, _only(0.0))[1] == pytest.approx(shift, rel=0.25)
    unsure = _quantiles(rebounds, _only(0.0), Slowing.by_drag(Measured(0.05, 0.02)))
    assert unsure[2] - unsure[0] > high - low


def test_a_friction_between_two_nodes_is_a_mixture_of_both():
    impacts = rebound_impacts(list(_rebounds(4, 30, 0.02)))
    low, middle, high = (
        np.exp(rubbed_likelihood(impacts, NO_DRAG, _only(friction)).log_likelihood)
        for friction in (0.015, 0.02, 0.025)
    )
    np.testing.assert_allclose(middle, 0.5 * (low + high), rtol=1e-9)


def test_terms_of_batches_add_up_and_need_rebounds():
    rebounds = list(_rebounds(6, 20, 0.02))
    whole = ContactTerms.of(rebounds)
    parts = ContactTerms.of(rebounds[:7]) + ContactTerms.of(rebounds[7:])
    first, second = (
        terms.rubbed_wall_likelihood(0.001, NO_DRAG, _any()) for terms in (whole, parts)
    )
    assert isinstance(first, Likelihood1D)
    np.testing.assert_allclose(first.log_likelihood, second.log_likelihood)
    assert ContactTerms.of(()).rubbed_wall_likelihood(0.001, NO_DRAG, _any()) is None
