"""The exponent of the restitution against the impact speed, from contacts at many speeds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_impact, drawn_rebound

from nanorocks_ros.inference.contacts.contact_likelihood import PAIR_ERRORS
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.contacts.impact_tables import LOSS_COLUMNS, impact_speeds
from nanorocks_ros.inference.contacts.projected_collisions import (
    ProjectedCollisions,
    RadiusExcess,
    projected_log_densities,
)
from nanorocks_ros.inference.contacts.restitution_exponent import MIN_CONTACTS
from nanorocks_ros.inference.flights.flight_losses import Slowing
from nanorocks_ros.records import Measured

ENDS = np.array([0.025, 0.5, 0.975])
REFERENCE = 3e-3


def law(value, exponent):
    return lambda speed: max(1.0 - (1.0 - value) * (speed / REFERENCE) ** exponent, 0.0)


def speeds_drawn(rng, n):
    return np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), n))


def rebounds(seed, n, value, exponent, relative_error=0.02):
    rng = np.random.default_rng(seed)
    restitution = law(value, exponent)
    for speed in speeds_drawn(rng, n):
        error = relative_error * speed
        noise = rng.normal(0.0, error, 2)
        yield drawn_rebound(speed + noise[0], restitution(speed) * speed + noise[1], error)


def collisions(seed, n, value, exponent):
    rng = np.random.default_rng(seed)
    restitution = law(value, exponent)
    return [
        drawn_impact(rng, restitution, spread=spread)[0] for spread in speeds_drawn(rng, n) / 4.0
    ]


@pytest.mark.parametrize('exponent', [0.0, 0.4])
def test_rebounds_tell_the_exponent_of_the_walls(exponent):
    errors = []
    for seed in range(20):
        walls = ContactTerms.of(rebounds(seed, 120, 0.9, exponent)).wall_exponent()
        errors.append((walls.exponent.mean - exponent) / walls.exponent.deviation)
    # The speed that slow contacts of films lose is taken for granted: it counts as an error.
    assert abs(np.mean(errors)) < 1.0
    assert np.std(errors) < 1.3


@pytest.mark.parametrize(('value', 'exponent'), [(0.75, 0.0), (0.75, 0.2), (0.85, 0.6)])
def test_collisions_tell_the_exponent_of_the_beads(value, exponent):
    errors = []
    for seed in range(12):
        beads = ContactTerms.of(collisions(seed, 100, value, exponent)).bead_exponent()
        errors.append((beads.exponent.mean - exponent) / beads.exponent.deviation)
        assert beads.exponent.deviation < 0.25
    assert abs(np.mean(errors)) < 0.7
    assert np.std(errors) < 1.4


def test_collisions_next_to_without_speed_say_nothing_of_the_exponent():
    # Of a drawn film: approach and parting of a collision that is none cancel, but for 3 nm/s.
    terms = ContactTerms.of(collisions(3, 100, 0.75, 0.2))
    slow = terms.collision_impacts[:2].copy()
    slow[:, LOSS_COLUMNS] = 3e-9
    with_slow = replace(terms, collision_impacts=np.concatenate([terms.collision_impacts, slow]))
    exponents = terms.bead_exponent(), with_slow.bead_exponent()
    assert exponents[1].exponent.mean == pytest.approx(exponents[0].exponent.mean, abs=1e-3)
    assert exponents[1].speed == pytest.approx(exponents[0].speed)
    bins = with_slow.bead_bins(ENDS)
    assert all(math.isfinite(part.restitution.value) for part in bins)


def test_the_restitution_is_that_at_the_reference_speed():
    walls = ContactTerms.of(rebounds(1, 300, 0.9, 0.4)).wall_exponent()
    assert walls.contacts == 300
    assert walls.speed == pytest.approx(math.sqrt(1e-3 * 1e-2), rel=0.1)
    assert walls.restitution == pytest.approx(law(0.9, 0.4)(walls.speed), abs=0.01)


def test_a_constant_restitution_is_given_a_chance_and_another_one_none():
    constant, falling = (
        ContactTerms.of(rebounds(2, 200, 0.9, exponent)).wall_exponent() for exponent in (0.0, 0.6)
    )
    assert constant.chance > 0.05
    assert falling.chance < 1e-4
    interval = falling.interval(ENDS)
    assert 0.0 < interval.lower < 0.6 < interval.upper


def test_contacts_of_more_cycles_add_up():
    parts = [ContactTerms.of(collisions(seed, 40, 0.75, 0.4)) for seed in (1, 2)]
    both = ContactTerms.of([*collisions(1, 40, 0.75, 0.4), *collisions(2, 40, 0.75, 0.4)])
    added, together = (terms.bead_exponent() for terms in (parts[0] + parts[1], both))
    assert added.contacts == together.contacts == 80
    assert added.exponent.mean == pytest.approx(together.exponent.mean, abs=1e-6)
    assert added.exponent.deviation < parts[0].bead_exponent().exponent.deviation


def test_too_few_contacts_tell_nothing():
    few = ContactTerms.of(rebounds(1, MIN_CONTACTS - 1, 0.9, 0.4))
    assert few.wall_exponent() is None
    assert few.bead_exponent() is None
    assert ContactTerms.of(rebounds(1, MIN_CONTACTS, 0.9, 0.4)).wall_exponent() is not None


def test_a_systematic_error_widens_the_interval():
    terms = ContactTerms.of(rebounds(3, 200, 0.9, 0.2))
    sure, unsure = (terms.wall_exponent(bias).exponent for bias in (0.0, 0.02))
    # The loss at the reference speed is 0.1.
    assert unsure.deviation == pytest.approx(math.hypot(sure.deviation, 0.2), rel=0.1)


def test_a_drag_known_later_counts_as_if_it_had_been_known_before():
    def slowed(drag):
        # Slow beads fly longer: without the drag the restitution seems to rise with speed.
        for rebound in rebounds(4, 200, 0.9, 0.0):
            time = 1e-3 / rebound.incoming.value
            late = replace(rebound, incoming_drag_time=time, outgoing_drag_time=time)
            yield dragged(replace(late, drag=drag), 0.0)

    drag = 0.05
    slowing = Slowing.by_drag(Measured(drag, 1e-3))
    told = ContactTerms.of(slowed(drag)).wall_exponent(0.0, slowing).exponent
    blind = ContactTerms.of(slowed(drag)).wall_exponent().exponent
    free = ContactTerms.of(slowed(0.0)).wall_exponent().exponent
    assert told.mean == pytest.approx(free.mean, abs=0.03)
    assert blind.mean < told.mean - 2.0 * told.deviation


def test_an_impact_speed_is_known_within_its_error():
    rng = np.random.default_rng(5)
    drawn = [drawn_impact(rng, law(0.8, 0.0), slowest=1e-3) for _ in range(300)]
    speeds, errors = impact_speeds([collision for collision, _ in drawn], 0.8)
    truth = np.array([speed for _, speed in drawn])
    pulls = (speeds - truth) / errors
    # The errors of collisions are stated larger by a factor.
    assert pulls.std() * PAIR_ERRORS == pytest.approx(1.0, abs=0.25)
    assert abs(pulls.mean()) < 0.3
    assert np.median(errors / truth) < 0.1


def test_all_speeds_after_a_collision_together_are_certain():
    collision, _ = drawn_impact(np.random.default_rng(8), law(0.6, 0.8))
    seen = ProjectedCollisions.of([collision])
    part = math.sqrt(1.0 - 0.25**2)

    def probability(restitution, *, tangent):
        partings = np.linspace(-1.0, 6.0, 701) * seen.approach[0]
        density = []
        for parting in partings:
            both = (seen.approach[0] + parting) / part
            speed = max(both, 1e-5) / 1.7
            for _ in range(20):
                speed = max(both, 1e-5) / (1.0 + restitution(speed))
            slope = 0.8 * (1.0 - restitution(speed)) if tangent else 0.0
            log = projected_log_densities(
                seen._replace(parting=np.array([parting])),
                np.array([restitution(speed)]),
                np.array([0.5]),
                [RadiusExcess(0.0, 0.0)],
                (0.0, 1e-12),
                slope,
            )
            density.append(math.exp(log[0, 0, 0, 0]))
        return float(np.trapezoid(density, partings))

    # Of the measured distance, whatever the speeds.
    distance = probability(lambda _: 0.7, tangent=False)
    falling = law(0.6, 0.8)
    assert probability(falling, tangent=True) / distance == pytest.approx(1.0, abs=0.01)
    assert probability(falling, tangent=False) / distance < 0.95
