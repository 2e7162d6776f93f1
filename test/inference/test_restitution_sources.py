"""Decay, contacts and both are told apart, and the headline is the source to be trusted."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce
from operator import add

import numpy as np
import pytest
from contact_draws import drawn_rebound
from wall_rebounds import wall_rebounds

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.decay.friction_weights import friction_weights
from nanorocks_ros.inference.flights.flight_losses import FlightLosses, Slowing
from nanorocks_ros.inference.likelihood_1d import Posterior1D
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.inference.restitution_sources import restitution_sources
from nanorocks_ros.inference.speed_dependence import SpeedDependence
from nanorocks_ros.records import Headline, Measured, Quality, headline_in_words, headline_of
from nanorocks_ros.settings import PriorSettings, SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

TRAY = load_trays()[1]
PRIOR = PriorSettings()
ENDS = np.array([0.025, 0.5, 0.975])
TIMES = np.arange(1.75, 20.0, 0.1)


@pytest.fixture(scope='module')
def tables():
    return tables_of(library_of(TRAY), TRAY, PRIOR)


def decay(tables, restitution, wall):
    settings = SimulationSettings(restitution=restitution, wall_restitution=wall, seed=9)
    (speed,) = cooling_runs(settings, TRAY, TIMES, [1]).mean_projected_speed
    likelihood = decay_likelihood(tables, TIMES, speed, 0.02 * speed, (0.014, 0.01))
    return likelihood.integrated()


def rebounds(wall, n=60):
    return ContactTerms.of(list(wall_rebounds(np.random.default_rng(1), n, 2.0, 17.0, wall)))


def test_where_decay_and_contacts_agree_both_count(tables):
    sources = restitution_sources(tables, decay(tables, 0.89, 0.97), rebounds(0.97), PRIOR)
    assert sources.headline is Headline.JOINT
    beads, walls = sources.intervals(ENDS)
    assert beads.lower < 0.89 < beads.upper
    assert walls.lower < 0.97 < walls.upper
    assert sources.correlation < 0.0
    # The decay alone is that without contacts.
    alone = restitution_sources(tables, decay(tables, 0.89, 0.97), ContactTerms.of(()), PRIOR)
    assert alone.headline is Headline.DECAY
    assert alone.intervals(ENDS)[0].lower == pytest.approx(
        float(sources.decay.quantiles(ENDS)[0]), abs=1e-12
    )
    assert alone.beads is alone.walls is None


def test_a_drag_below_0_by_chance_does_not_lower_the_walls(tables):
    seen = wall_rebounds(np.random.default_rng(1), 60, 2.0, 17.0, 0.97)
    times = {'incoming_drag_time': 0.3, 'outgoing_drag_time': 0.3}
    contacts = ContactTerms.of([replace(rebound, **times) for rebound in seen])
    walls = []
    for drag in (-0.01, 0.0):
        unknown = np.full(2, np.nan)
        losses = FlightLosses(
            drag=Measured(drag, 0.002),
            acceleration=unknown,
            covariance=np.full((2, 2), np.nan),
            rubbed=Slowing.by_drag(Measured(0.0, 0.002)),
            fitted=Slowing.by_drag(Measured(drag, 0.002)),
        )
        sources = restitution_sources(
            tables, decay(tables, 0.89, 0.97), contacts, PRIOR, losses=losses
        )
        assert sources.drag.value == drag
        walls.append(sources.intervals(ENDS)[1].value)
    # Taken as measured it would do so by 0.01 /s for 0.6 s.
    assert walls[0] == pytest.approx(walls[1], abs=0.1 * 0.01 * 0.6)


def test_where_they_do_not_only_the_contacts_count(tables):
    sources = restitution_sources(tables, decay(tables, 0.95, 1.0), rebounds(0.82), PRIOR)
    assert sources.headline is Headline.CONTACTS
    beads, walls = sources.intervals(ENDS)
    assert math.isnan(beads.value)
    assert walls.lower < 0.82 < walls.upper
    assert sources.correlation == 0.0
    assert sources.means[1].value == pytest.approx(0.82, abs=0.02)


def test_decay_and_rebounds_agree_on_soft_walls(tables):
    sources = restitution_sources(tables, decay(tables, 0.89, 0.6), rebounds(0.6), PRIOR)
    assert sources.headline is Headline.JOINT
    beads, walls = sources.intervals(ENDS)
    assert walls.lower < 0.6 < walls.upper < 0.65
    assert beads.lower < 0.89 < beads.upper


def test_the_decay_of_rough_beads_holds_the_truth_where_their_friction_is_told(tables):
    rubbed = {
        'tangential_restitution': 0.4,
        'wall_tangential_restitution': 0.4,
        'friction': 0.03,
        'wall_friction': 0.03,
    }
    settings = SimulationSettings(restitution=0.89, wall_restitution=0.97, seed=9, **rubbed)
    runs = cooling_runs(settings, TRAY, TIMES, range(6)).mean_projected_speed
    likelihood = reduce(
        add,
        [decay_likelihood(tables, TIMES, speed, 0.02 * speed, (0.014, 0.01)) for speed in runs],
    )
    known = 0.97, 0.97
    smooth = posterior_of(tables, likelihood.integrated(), known).quantiles(ENDS)
    assert smooth[2] < 0.89
    prior = replace(PRIOR, friction=0.03, friction_error=0.003)
    weights = friction_weights(prior, ContactTerms.of(()))
    told = posterior_of(tables, likelihood.integrated(weights), known).quantiles(ENDS)
    assert told[0] < 0.89 < told[2]
    assert told[1] > smooth[1] + 0.1


def test_a_decay_that_does_not_count_leaves_the_contacts(tables):
    nothing = np.zeros(tables.mean.shape[0])
    sources = restitution_sources(tables, nothing, rebounds(0.97), PRIOR, decay_counts=False)
    assert sources.headline is Headline.CONTACTS


def law():
    """The law of contacts with an exponent of 0.5 and 0.8 at 3 mm/s."""
    rng = np.random.default_rng(2)
    speeds = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), 120))
    return ContactTerms.of(
        drawn_rebound(speed, speed * (1.0 - 0.2 * (speed / 3e-3) ** 0.5), 0.02 * speed)
        for speed in speeds
    ).wall_exponent()


def test_a_law_of_the_impact_speed_is_the_headline_weighted_by_energy(tables):
    beads = law()
    sources = restitution_sources(
        tables,
        decay(tables, 0.89, 0.97),
        rebounds(0.97),
        PRIOR,
        dependence=SpeedDependence(beads=beads),
    )
    assert sources.headline is Headline.CONTACTS
    interval = sources.intervals(ENDS)[0]
    assert [interval.lower, interval.value, interval.upper] == pytest.approx(
        beads.law.energy_weighted.quantiles(ENDS)
    )
    assert sources.means[0].value == pytest.approx(beads.law.energy_weighted.mean)
    # The constant one is beside it, unknown without collisions.
    assert math.isnan(sources.contact_intervals(ENDS)[0].value)


def test_a_law_that_is_not_certain_has_its_share_of_the_headline(tables):
    arguments = tables, decay(tables, 0.89, 0.97), rebounds(0.97), PRIOR
    constant = restitution_sources(*arguments)
    hint = SpeedDependence(beads=wide(law()))
    shared = restitution_sources(*arguments, dependence=hint)
    assert shared.headline is Headline.JOINT
    weight = hint.bead_weight
    assert 0.0 < weight < 1.0
    alone, without = hint.bead_law.energy_weighted, constant.means[0]
    by_law = (shared.means[0].value - (1.0 - weight) * without.value) / weight
    # Contacts tell the law; decay and contacts together tell how far off a constant it may be.
    loss = 1.0 - without.value
    assert min(alone.mean, without.value - 0.25 * loss) < by_law < max(alone.mean, without.value)
    assert shared.means[0].error > constant.means[0].error
    assert shared.means[1] == constant.means[1]
    assert shared.intervals(ENDS)[1] == constant.intervals(ENDS)[1]


def wide(exponent):
    """The same with an exponent that may well be 0."""
    axis = np.linspace(-1.0, 2.0, 3001)
    weight = np.exp(-0.5 * ((axis - 0.3) / 0.2) ** 2)
    return replace(
        exponent, exponent=Posterior1D(restitution=axis, probability=weight / weight.sum())
    )


@pytest.mark.parametrize(
    ('contacts', 'tension', 'friction', 'expected', 'words'),
    [
        (0, 0.0, Measured(), Headline.DECAY, 'decay alone'),
        (9, 2.4, Measured(0.002, 0.002), Headline.JOINT, 'decay and contacts together'),
        (9, 2.6, Measured(), Headline.CONTACTS, 'differ by 2.6 standard deviations'),
        (9, 0.5, Measured(0.01, 0.004), Headline.CONTACTS, 'a friction of 0.010 +- 0.004'),
        (9, 0.5, Measured(-0.01, 0.004), Headline.JOINT, 'decay and contacts together'),
    ],
)
def test_the_headline_and_its_reason(contacts, tension, friction, expected, words):
    headline = headline_of(contacts, tension, friction)
    assert headline is expected
    assert words in headline_in_words(headline, tension, friction)


@pytest.mark.parametrize(
    ('quality', 'words'),
    [
        (Quality.ACCELERATED, 'since an acceleration drives the beads'),
        (
            Quality.SPEED_DEPENDENT,
            'since contacts at different speeds contradict a constant',
        ),
    ],
)
def test_a_flag_with_which_the_decay_does_not_count_is_the_reason(quality, words):
    assert words in headline_in_words(Headline.CONTACTS, 0.5, Measured(), quality)


@pytest.mark.parametrize('headline', [Headline.DECAY, Headline.JOINT])
def test_beads_that_count_as_smooth_are_named_beside_the_source(headline):
    words = headline_in_words(headline, 0.5, Measured(), Quality.FRICTION_UNKNOWN)
    assert words == headline_in_words(headline, 0.5, Measured()) + (
        ', of beads that count as smooth'
    )
