"""The friction of side walls follows from the tangential speeds of rebounds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from wall_rebounds import wall_rebounds

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.wall_friction import (
    TANGENTIAL_SIGMAS,
    friction_table,
    wall_friction,
)
from nanorocks_ros.stages.contacts.pair_tests import MAX_SIGMAS

ERROR = 5e-5


def sliding(rng, n, friction, error=ERROR):
    """Recorded rebounds of beads that slide along the wall, whose tangential loss is hidden."""
    recorded = []
    while len(recorded) < n:
        for rebound in wall_rebounds(rng, n, 0.0, 20.0, error=1e-5):
            before = rng.normal(0.0, 2e-3)
            change = rebound.incoming.value + rebound.outgoing.value
            loss = math.copysign(min(friction * change, abs(before)), before)
            after = before - loss + rng.normal(0.0, error)
            if abs(after - before) < MAX_SIGMAS * error:
                recorded.append(
                    replace(
                        rebound,
                        tangential_incoming=before,
                        tangential_outgoing=after,
                        tangential_error=error,
                    )
                )
    return recorded[:n]


def test_the_cut_is_that_of_the_contact_finder():
    assert TANGENTIAL_SIGMAS == MAX_SIGMAS


@pytest.mark.parametrize('friction', [0.0, 0.01, 0.04])
def test_sliding_beads_give_the_friction_though_large_losses_are_not_recorded(friction):
    rng = np.random.default_rng(7)
    estimates = [wall_friction(friction_table(sliding(rng, 60, friction))) for _ in range(12)]
    values = np.array([estimate.value for estimate in estimates])
    errors = np.array([estimate.error for estimate in estimates])
    assert abs(values.mean() - friction) < 0.15 * friction + 3.0 * errors.mean() / math.sqrt(12)
    assert (abs(values - friction) < 3.0 * errors + 0.15 * friction).all()
    assert np.median(errors) < 0.012


def test_a_rebound_that_drag_takes_across_the_cut_does_not_decide():
    rebounds = sliding(np.random.default_rng(3), 16, 0.02)
    first = rebounds[0]
    loss = math.copysign(1.8 * TANGENTIAL_SIGMAS * ERROR, first.tangential_incoming)
    beyond = replace(first, tangential_outgoing=first.tangential_incoming - loss)
    without = wall_friction(friction_table(rebounds[1:]))
    estimate = wall_friction(friction_table([beyond, *rebounds[1:]]))
    assert abs(estimate.value - without.value) < 2.0 * without.error


def test_without_rebounds_nothing_is_known_of_the_friction():
    assert not ContactTerms.of(()).wall_friction.known


def test_tables_of_rebounds_add_up():
    rebounds = sliding(np.random.default_rng(2), 20, 0.01)
    parts = ContactTerms.of(rebounds[:8]) + ContactTerms.of(rebounds[8:])
    whole = ContactTerms.of(rebounds)
    assert parts.wall_friction.value == pytest.approx(whole.wall_friction.value, rel=1e-9)
