"""Log-likelihood tables of contacts add up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from contact_draws import drawn_collisions, drawn_rebounds

from nanorocks_ros.inference.contacts.contact_estimate import contact_estimate
from nanorocks_ros.inference.contacts.contact_likelihood import (
    pair_log_likelihood,
    rebound_log_likelihood,
)
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.rebound_reading import ReboundReading
from nanorocks_ros.records import Measured, PairCollision, Rebound

FINE = np.linspace(0.5, 1.0, 1001)


def contacts():
    return [*drawn_rebounds(np.random.default_rng(1), 40, 0.9), *drawn_collisions(2, 40, 0.8)]


def sum_of(first, *others):
    total = ContactTerms.of(first)
    for batch in others:
        total += ContactTerms.of(batch)
    return total


def test_tables_of_parts_add_up_to_the_table_of_all_contacts():
    every = contacts()
    whole = ContactTerms.of(every)
    parts = sum_of(every[:15], every[15:60], every[60:])
    assert (parts.rebounds, parts.collisions) == (whole.rebounds, whole.collisions) == (40, 40)
    np.testing.assert_allclose(parts.walls, whole.walls, rtol=1e-9)
    np.testing.assert_allclose(parts.beads, whole.beads, rtol=1e-9)


def test_the_nodes_give_the_same_estimate_as_a_fine_grid():
    every = contacts()
    terms = ContactTerms.of(every)
    pairs = [contact for contact in every if isinstance(contact, PairCollision)]
    walls = [contact for contact in every if isinstance(contact, Rebound)]
    for term, exact in (
        (terms.bead_likelihood(), pair_log_likelihood(pairs, FINE)),
        (terms.wall_likelihood(), rebound_log_likelihood(walls, FINE)),
    ):
        grid = FINE[term.restitution[0] <= FINE]
        estimate, expected = contact_estimate(grid, term.at(grid)), contact_estimate(FINE, exact)
        near = 0.02 * expected.restitution_error
        assert estimate.restitution == pytest.approx(expected.restitution, abs=near)
        assert estimate.restitution_error == pytest.approx(expected.restitution_error, rel=0.02)


def test_rebounds_of_a_rolling_shutter_are_read_again_and_their_friction_stays():
    every = contacts()
    reading = ReboundReading(along_columns=Measured(0.5, 0.1), along_rows=Measured(-0.5, 0.1))
    read = [reading.read(each) if isinstance(each, Rebound) else each for each in every]
    seen, at_once = ContactTerms.of(every), ContactTerms.of(read)
    again = seen.read_again([each for each in read if isinstance(each, Rebound)], 0.01)
    for name in ('walls', 'rebound_losses', 'rebound_impacts', 'beads', 'collision_losses'):
        np.testing.assert_array_equal(getattr(again, name), getattr(at_once, name))
    assert np.abs(again.walls - seen.walls).max() > 1.0
    exact, wider = (terms.wall_likelihood().posterior((0.5, 1.0)) for terms in (at_once, again))
    assert wider.deviation == pytest.approx(math.hypot(exact.deviation, 0.01), rel=0.05)
    assert (again + again).reading_error == pytest.approx(0.01)
    assert (again + seen).reading_error == pytest.approx(0.005)
    # As exact as it would be from the speeds as they are read again.
    friction, exact = again.wall_friction, at_once.wall_friction
    assert friction.value == pytest.approx(exact.value, abs=0.02 * exact.error)
    assert friction.error == pytest.approx(exact.error, rel=0.02)


def test_without_contacts_there_is_no_likelihood():
    terms = ContactTerms.of(())
    assert terms.bead_likelihood() is None
    assert terms.wall_likelihood() is None


def test_a_common_systematic_error_adds_in_quadrature():
    terms = ContactTerms.of(contacts())
    for term, bias, low in (
        (terms.bead_likelihood, 0.02, 0.5),
        (terms.wall_likelihood, 0.01, 0.8),
    ):
        grid = np.linspace(low, 1.0, 1001)
        sure, unsure = (contact_estimate(grid, term(value).at(grid)) for value in (0.0, bias))
        expected_error = np.hypot(sure.restitution_error, bias)
        assert unsure.restitution_error == pytest.approx(expected_error, rel=0.1)
        assert unsure.restitution == pytest.approx(sure.restitution, abs=0.3 * bias)
