"""Drag and acceleration from flights with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bent_flights import bent_flights

from nanorocks_ros.inference.flights.flight_losses import (
    MIN_FLIGHTS,
    Slowing,
    flight_losses,
    flight_table,
)
from nanorocks_ros.records import Measured

WIDE = Measured(0.0, 0.2)


def _pulls(drag, number=60, runs=150, **values):
    """Errors of drag and acceleration in stated errors, (runs, 3)."""
    pulls = []
    for seed in range(runs):
        acceleration = np.array([2e-5, -1e-5])
        flights = bent_flights(number, drag, acceleration, seed=seed, **values)
        losses = flight_losses(flight_table(flights), WIDE)
        errors = np.sqrt(np.diag(losses.covariance))
        pulls.append(
            [
                (losses.drag.value - drag) / losses.drag.error,
                *((losses.acceleration - acceleration) / errors),
            ]
        )
    return np.array(pulls)


@pytest.mark.parametrize('drag', [0.0, 0.05])
def test_drag_and_acceleration_are_found_within_their_errors(drag):
    pulls = _pulls(drag)
    assert np.abs(pulls.mean(axis=0)).max() < 0.3
    assert pulls.std(axis=0) == pytest.approx(1.0, abs=0.2)


def test_errors_that_are_stated_too_small_do_not_make_the_results_too_sure():
    table = flight_table(bent_flights(200, 0.02))
    stated = flight_losses(table, WIDE)
    table[:, 4] /= 4.0
    assert flight_losses(table, WIDE).drag.error == pytest.approx(stated.drag.error, rel=1e-6)


def test_flights_with_unseen_hits_hardly_shift_the_drag():
    clean = np.mean([_drag(0.0, seed) for seed in range(20)])
    hit = np.mean([_drag(0.1, seed) for seed in range(20)])
    assert clean == pytest.approx(0.02, abs=5e-4)
    # Least squares would make it 0.04.
    assert hit == pytest.approx(0.02, abs=2.5e-3)


def _drag(kinks, seed):
    return flight_losses(
        flight_table(bent_flights(200, 0.02, seed=seed, kinks=kinks)), WIDE
    ).drag.value


def test_flights_that_are_no_parabola_are_left_out():
    flights = list(bent_flights(100, 0.02))
    kinked = [
        replace(flight, mean_acceleration=np.full(2, 1e-2), reduced_chi_square=9.0)
        for flight in flights[:30]
    ]
    losses = flight_losses(flight_table([*flights, *kinked]), WIDE)
    assert losses.flights == 100
    assert losses.drag == flight_losses(flight_table(flights), WIDE).drag


def test_the_drag_of_another_species_is_scaled():
    flights = [replace(flight, relative_drag=2.0) for flight in bent_flights(200, 0.04)]
    assert flight_losses(flight_table(flights), WIDE).drag.value == pytest.approx(0.02, abs=1e-3)


def _mixed(drag, ratio, seed, first=60, second=160):
    """Flights of a mixture whose second species is slowed `ratio` times as much as expected."""
    return flight_table(
        [
            *bent_flights(first, drag, seed=seed),
            *bent_flights(
                second, 1.8 * ratio * drag, seed=1000 + seed, species=1, relative_drag=1.8
            ),
        ]
    )


@pytest.mark.parametrize('ratio', [0.9, 1.2])
def test_the_drag_of_the_first_species_has_the_error_of_its_ratio_to_the_others(ratio):
    pulls, slowed = [], []
    for seed in range(60):
        losses = flight_losses(_mixed(0.07, ratio, seed), WIDE)
        drag = losses.of_first_species(losses.drag)
        pulls.append((drag.value - 0.07) / drag.error)
        slowed.append(losses.slowing.drag.value / (0.07 * ratio))
    # By its error without the ratio it was off by 15 and 27 times that.
    assert np.abs(pulls).mean() < 2.0
    # What slows the second species, which tells nearly all, is right.
    assert np.mean(slowed) == pytest.approx(1.0, abs=0.03)


def test_a_ratio_costs_nothing_without_drag_or_without_another_species():
    still = flight_losses(_mixed(0.0, 1.0, 3), WIDE)
    assert still.of_first_species(still.drag).error == pytest.approx(still.drag.error, rel=0.05)
    alone = flight_losses(_mixed(0.07, 1.0, 4, second=0), WIDE)
    assert alone.of_first_species(alone.drag) == alone.drag
    others = flight_losses(_mixed(0.07, 1.0, 4, first=0), WIDE)
    assert others.of_first_species(others.drag).error == pytest.approx(0.1 * 0.07, rel=0.1)


def test_a_prior_is_weighed_with_the_flights_and_a_known_drag_stays():
    table = flight_table(bent_flights(100, 0.02))
    alone = flight_losses(table, Measured(0.0, 1e3)).drag
    together = flight_losses(table, Measured(0.03, alone.error)).drag
    assert together.value == pytest.approx(0.5 * (0.03 + alone.value), rel=1e-3)
    assert together.error == pytest.approx(alone.error / np.sqrt(2.0), rel=1e-3)
    assert flight_losses(table, Measured(0.03, 0.0)).drag == Measured(0.03, 0.0)


def test_few_flights_leave_the_prior_and_none_the_drag_as_given():
    few = flight_table(bent_flights(MIN_FLIGHTS - 1, 0.02))
    losses = flight_losses(few, WIDE)
    assert losses.drag == WIDE
    assert not losses.is_accelerated
    assert np.isnan(losses.magnitude(0.95).upper)
    assert flight_losses(flight_table(()), Measured(0.01, 0.2)).drag == Measured(0.01, 0.0)


def test_a_gas_does_not_speed_beads_up_between_contacts():
    losses = flight_losses(flight_table(bent_flights(200, -0.02)), WIDE)
    assert losses.drag.value == pytest.approx(-0.02, abs=3.0 * losses.drag.error)
    assert losses.slowing.drag.value == 0.0
    assert losses.slowing.drag.error == pytest.approx(losses.drag.error)
    positive = flight_losses(flight_table(bent_flights(200, 0.02)), WIDE)
    assert positive.slowing.drag == positive.drag


def test_an_acceleration_is_seen_and_bounded():
    still = flight_losses(flight_table(bent_flights(200, 0.0)), WIDE)
    assert not still.is_accelerated
    size = still.magnitude(0.95)
    assert 0.0 <= size.lower < size.value < size.upper < 1e-5
    moving = flight_losses(flight_table(bent_flights(200, 0.0, (3e-5, -4e-5))), WIDE)
    assert moving.is_accelerated
    size = moving.magnitude(0.95)
    assert size.lower < 5e-5 < size.upper


@pytest.mark.parametrize(('drag', 'rate'), [(0.02, 20.0), (0.05, 10.0)])
def test_drag_and_friction_are_told_apart_within_their_errors(drag, rate):
    pulls = []
    for seed in range(100):
        flights = bent_flights(200, drag, seed=seed, friction_rate=rate)
        rubbed = flight_losses(flight_table(flights), WIDE).rubbed
        pulls.append((rubbed.values - [drag, rate]) / np.sqrt(np.diag(rubbed.covariance)))
    # Their errors are taken twice, since real hits are single events.
    assert np.abs(np.mean(pulls, axis=0)).max() < 0.25
    assert np.std(pulls, axis=0) == pytest.approx(0.5, abs=0.12)


def test_neither_drag_nor_friction_beside_each_other_is_below_0():
    for seed in range(10):
        flights = bent_flights(100, 0.0, seed=seed)
        rubbed = flight_losses(flight_table(flights), WIDE).rubbed
        errors = np.sqrt(np.diag(rubbed.covariance))
        assert (rubbed.values >= 0.0).all()
        assert (rubbed.values < 4.0 * errors).all()


def test_friction_alone_passes_for_drag_where_it_is_left_out():
    flights = bent_flights(200, 0.0, friction_rate=10.0)
    losses = flight_losses(flight_table(flights), WIDE)
    assert losses.drag.value > 5.0 * losses.drag.error
    assert abs(losses.rubbed.drag.value) < 3.0 * losses.rubbed.drag.error


def test_a_known_drag_stays_beside_friction():
    table = flight_table(bent_flights(200, 0.02, friction_rate=10.0))
    assert flight_losses(table, Measured(0.02, 0.0)).rubbed.drag == Measured(0.02, 0.0)


def test_the_more_friction_the_less_drag_do_flights_leave():
    losses = flight_losses(flight_table(bent_flights(200, 0.02, friction_rate=10.0)), WIDE)
    fitted = losses.fitted
    rates = np.array([0.0, 10.0, 20.0])
    beside = [fitted.beside_friction(rate, 0.0) for rate in rates]
    drags = np.array([drag.value for drag, _ in beside])
    assert (np.diff(drags) < 0.0).all()
    # Without friction all that slows the flights is drag.
    assert drags[0] > losses.drag.value > fitted.values[0]
    assert beside[1][1] > max(beside[0][1], beside[2][1])
    # Mean and covariance of both follow from the drag beside each rate and its likelihood.
    grid = fitted.values[1] + np.sqrt(fitted.covariance[1, 1]) * np.linspace(-6.0, 6.0, 2001)
    beside = [fitted.beside_friction(rate, 0.0) for rate in grid]
    weight = np.exp([log_likelihood for _, log_likelihood in beside])
    weight /= weight.sum()
    drags = np.array([drag.value for drag, _ in beside])
    mean = weight @ drags
    assert mean == pytest.approx(fitted.values[0])
    spread = beside[0][0].error ** 2 + weight @ (drags - mean) ** 2
    assert spread == pytest.approx(fitted.covariance[0, 0], rel=1e-4)
    assert weight @ ((drags - mean) * grid) == pytest.approx(fitted.covariance[0, 1], rel=1e-3)


def test_an_unsure_friction_rate_leaves_the_drag_less_sure():
    fitted = flight_losses(flight_table(bent_flights(200, 0.02, friction_rate=10.0)), WIDE).fitted
    sure, unsure = (fitted.beside_friction(10.0, error)[0] for error in (0.0, 20.0))
    assert unsure.error > sure.error
    known = Measured(0.02, 0.001)
    assert Slowing.by_drag(known).beside_friction(10.0, 5.0) == (known, 0.0)
