"""Contacts in a gas: speeds at the contact from those in the middle of flights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_collisions, drawn_rebounds

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import (
    dragged,
    loss_beside_contacts,
    loss_sums,
)
from nanorocks_ros.inference.flights.flight_losses import Slowing
from nanorocks_ros.records import Measured

BEFORE, AFTER = 0.3, 0.5
DRAG = 0.05


def _rebounds(n=60, restitution=0.9, seed=3):
    """Rebounds in a gas, with the speeds in the middle of the flights beside them."""
    for rebound in drawn_rebounds(np.random.default_rng(seed), n, restitution, 0.01):
        yield replace(
            rebound,
            incoming=_scaled(rebound.incoming, math.exp(DRAG * BEFORE)),
            outgoing=_scaled(rebound.outgoing, math.exp(-DRAG * AFTER)),
            incoming_drag_time=BEFORE,
            outgoing_drag_time=AFTER,
        )


def _scaled(speed, factor):
    return Measured(factor * speed.value, factor * speed.error)


def test_a_rebound_gets_back_the_speeds_at_the_contact_and_those_of_the_middle_again():
    (still,) = drawn_rebounds(np.random.default_rng(3), 1, 0.9, 0.01)
    (slowed,) = _rebounds(1)
    at_contact = dragged(slowed, DRAG)
    assert at_contact.incoming.value == pytest.approx(still.incoming.value)
    assert at_contact.outgoing.value == pytest.approx(still.outgoing.value)
    assert at_contact.drag == DRAG
    again = dragged(at_contact, 0.0)
    assert again.incoming.value == pytest.approx(slowed.incoming.value)
    assert again.outgoing.error == pytest.approx(slowed.outgoing.error)


def test_each_bead_of_a_collision_is_corrected_by_its_own_times():
    (collision,) = drawn_collisions(2, 1, 0.8)
    times = np.array([0.2, 0.4])
    slowed = replace(collision, before_drag_times=times, after_drag_times=2.0 * times)
    corrected = dragged(slowed, DRAG)
    for bead, time in enumerate(times):
        np.testing.assert_allclose(
            corrected.before[bead], collision.before[bead] * math.exp(-DRAG * time)
        )
        np.testing.assert_allclose(
            corrected.after[bead], collision.after[bead] * math.exp(2.0 * DRAG * time)
        )


def test_a_drag_known_later_shifts_the_walls_as_if_it_had_been_known_before():
    late = ContactTerms.of(_rebounds())
    early = ContactTerms.of(dragged(rebound, DRAG) for rebound in _rebounds())
    drag = Measured(DRAG, 0.0)
    walls = [
        terms.wall_likelihood(0.0, Slowing.by_drag(drag)).posterior((0.5, 1.0))
        for terms in (late, early)
    ]
    assert walls[1].mean == pytest.approx(0.9, abs=3.0 * walls[1].deviation)
    assert walls[0].mean == pytest.approx(walls[1].mean, abs=5e-4)
    # Without the drag they would read too low by it times both times.
    blind = late.wall_likelihood().posterior((0.5, 1.0))
    assert blind.mean == pytest.approx(walls[1].mean * math.exp(-DRAG * 0.8), abs=5e-4)


def test_an_uncertain_drag_widens_the_interval_of_the_walls():
    terms = ContactTerms.of(_rebounds())
    sure, unsure = (
        terms.wall_likelihood(0.0, Slowing.by_drag(Measured(DRAG, error))).posterior((0.5, 1.0))
        for error in (0.0, 0.01)
    )
    expected = math.hypot(sure.deviation, 0.9 * 0.01 * (BEFORE + AFTER))
    assert unsure.deviation == pytest.approx(expected, rel=0.05)


def test_sums_add_up_and_hold_what_is_left_to_correct():
    rebounds = [dragged(rebound, 0.02) for rebound in _rebounds()]
    sums = loss_sums(rebounds[:20]) + loss_sums(rebounds[20:])
    np.testing.assert_allclose(sums, loss_sums(rebounds))
    loss = loss_beside_contacts(sums, Slowing.by_drag(Measured(DRAG, 0.001)))
    assert loss.value == pytest.approx(0.8 * (DRAG - 0.02))
    assert loss.error == pytest.approx(0.8 * 0.001)
    nothing = loss_beside_contacts(loss_sums([]), Slowing.by_drag(Measured(DRAG, 0.001)))
    assert nothing == Measured(0.0, 0.0)


def test_friction_of_floor_and_lid_lifts_and_widens_what_the_walls_read():
    terms = ContactTerms.of(
        replace(rebound, friction_length=2e-3)
        for rebound in drawn_rebounds(np.random.default_rng(3), 60, 0.9, 0.01)
    )
    smooth, rough = (
        Slowing(values=np.array([0.0, rate]), covariance=np.diag([0.0, error**2]))
        for rate, error in ((0.0, 0.0), (10.0, 1.0))
    )
    plain, rubbed = (
        terms.wall_likelihood(0.0, slowing).posterior((0.5, 1.0)) for slowing in (smooth, rough)
    )
    # Of a loss of 2 % by the rate, the part that does not end the flights beside a contact.
    assert rubbed.mean - plain.mean == pytest.approx(0.9 * 0.014, rel=0.1)
    assert rubbed.deviation > math.hypot(plain.deviation, 0.9 * 0.1 * 0.02)


def test_a_friction_rate_below_0_by_chance_adds_no_spread():
    sums = loss_sums([replace(rebound, friction_length=2e-3) for rebound in _rebounds()])
    slowing = Slowing(values=np.array([0.0, -1.0]), covariance=np.zeros((2, 2)))
    assert loss_beside_contacts(sums, slowing).error == 0.0
