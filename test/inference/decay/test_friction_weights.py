"""The friction of floor, lid and walls: its prior, and what rebounds say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from wall_rebounds import wall_rebounds

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.friction_weights import friction_weights, is_friction_told
from nanorocks_ros.records import Measured
from nanorocks_ros.settings import PriorSettings

PRIOR = PriorSettings()
TOLD = replace(PRIOR, friction=0.05, friction_error=0.01)
NONE = ContactTerms.of(())


def sliding(friction, n=40):
    """Rebounds of beads that lose friction times the change of their normal speed."""
    rng = np.random.default_rng(3)
    contacts = []
    for rebound in wall_rebounds(rng, n, 2.0, 17.0, error=2e-5):
        change = rebound.incoming.value + rebound.outgoing.value
        after = 3e-3 - friction * change + rng.normal(0.0, 5e-5)
        contacts.append(
            replace(
                rebound,
                tangential_incoming=3e-3,
                tangential_outgoing=after,
                tangential_error=5e-5,
            )
        )
    return ContactTerms.of(contacts)


def mean(weights):
    return float(weights.weight @ weights.friction)


def test_without_rebounds_the_friction_is_that_of_the_prior_if_it_tells_one():
    assert friction_weights(PRIOR, NONE) is None
    weights = friction_weights(TOLD, NONE)
    assert weights.weight.sum() == pytest.approx(1.0)
    assert weights.friction[np.argmax(weights.weight)] == pytest.approx(0.05, abs=2e-3)
    within = weights.weight[np.abs(weights.friction - 0.05) <= 0.01].sum()
    assert within == pytest.approx(0.5, abs=0.1)


def test_rebounds_without_friction_exclude_any_that_matters():
    weights = friction_weights(PRIOR, sliding(0.0))
    assert weights.highest < 0.005


@pytest.mark.parametrize('friction', [0.01, 0.02])
def test_rebounds_with_friction_overrule_the_prior(friction):
    weights = friction_weights(PRIOR, sliding(friction))
    # What rebounds show is a lower estimate.
    assert friction < mean(weights) < 3.0 * friction
    assert weights.weight[weights.friction < 0.5 * friction].sum() < 0.01


def test_a_likelihood_that_does_not_depend_on_friction_stays_as_it_is():
    nodes = np.array([0.0, 0.004, 0.012, 0.035, 0.1])
    values = np.array([-3.0, 2.0, -500.0])
    mixed = friction_weights(TOLD, NONE).mixed(nodes, np.tile(values, (5, 1)))
    np.testing.assert_allclose(mixed, values, atol=1e-12)


def test_a_friction_without_weight_does_not_count_however_likely_it_makes_a_decay():
    nodes = np.array([0.0, 0.004, 0.012, 0.035, 0.1])
    weights = friction_weights(PRIOR, sliding(0.0, 2000))
    assert weights.weight[-1] == 0.0
    logs = np.array([[0.0], [-1.0], [-3.0], [0.0], [9000.0]]) + np.array([0.0, -5000.0])
    mixed = weights.mixed(nodes, logs)
    assert mixed == pytest.approx([0.0, -5000.0], abs=1.0)


def test_a_friction_that_is_known_selects_its_likelihood():
    nodes = np.array([0.0, 0.004, 0.012, 0.035, 0.1])
    known = friction_weights(replace(PRIOR, friction=0.012, friction_error=1e-4), sliding(0.012))
    logs = np.array([[-50.0, 0.0], [-20.0, -5.0], [0.0, -20.0], [-20.0, -60.0], [-90.0, -300.0]])
    mixed = known.mixed(nodes, logs)
    assert mixed[0] == pytest.approx(0.0, abs=0.5)
    assert mixed[1] == pytest.approx(-20.0, abs=3.0)


def test_the_friction_is_told_by_the_prior_or_by_enough_rebounds():
    assert not is_friction_told(PRIOR, NONE.wall_friction)
    assert is_friction_told(TOLD, NONE.wall_friction)
    # Spare beads were found to be smooth.
    assert is_friction_told(replace(PRIOR, friction_error=0.001), NONE.wall_friction)
    assert is_friction_told(PRIOR, sliding(0.0).wall_friction)
    assert is_friction_told(PRIOR, sliding(0.02).wall_friction)


@pytest.mark.parametrize(
    ('shown', 'told'),
    [
        (Measured(0.007, 0.03), False),
        (Measured(0.09, 0.085), False),
        (Measured(0.09, 0.03), True),
        (Measured(0.004, 0.007), True),
        # Far below 0 by chance, few rebounds exclude less than they seem to.
        (Measured(-0.02, 0.015), False),
        (Measured(-0.02, 0.008), True),
        (Measured(-1.0, 0.001), True),
    ],
)
def test_a_friction_is_told_where_rebounds_exclude_a_strong_one_or_show_one(shown, told):
    assert is_friction_told(PRIOR, shown) == told
