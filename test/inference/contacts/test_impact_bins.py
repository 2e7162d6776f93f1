"""Restitutions in ranges of the impact speed."""

from __future__ import annotations

import itertools

import numpy as np
from contact_draws import drawn_impact, drawn_rebound

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms

ENDS = np.array([0.16, 0.5, 0.84])


def law(speed):
    return 1.0 - 0.15 * (speed / 3e-3) ** 0.5


def rebounds(seed, n):
    rng = np.random.default_rng(seed)
    for speed in np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), n)):
        noise = rng.normal(0.0, 0.02 * speed, 2)
        yield drawn_rebound(speed + noise[0], law(speed) * speed + noise[1], 0.02 * speed)


def test_ranges_hold_all_rebounds_and_follow_their_law():
    errors = []
    for seed in range(10):
        bins = ContactTerms.of(rebounds(seed, 200)).wall_bins(ENDS)
        assert [speed_bin.contacts for speed_bin in bins] == [25] * 8
        for lower, upper in itertools.pairwise(bins):
            assert lower.lowest <= lower.speed <= lower.highest <= upper.lowest
        errors += [
            (each.restitution.value - law(each.speed))
            / (0.5 * (each.restitution.upper - each.restitution.lower))
            for each in bins
        ]
    assert abs(np.mean(errors)) < 0.5
    # Their errors are scaled for a constant restitution, so rather too large.
    assert 0.3 < np.std(errors) < 1.3


def test_ranges_of_collisions_follow_their_law():
    errors = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        spreads = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), 160)) / 4.0
        drawn = [drawn_impact(rng, law, spread=spread)[0] for spread in spreads]
        bins = ContactTerms.of(drawn).bead_bins(ENDS)
        assert sum(each.contacts for each in bins) == 160
        errors += [
            (each.restitution.value - law(each.speed))
            / (0.5 * (each.restitution.upper - each.restitution.lower))
            for each in bins
        ]
    assert abs(np.mean(errors)) < 0.7
    assert np.std(errors) < 1.5


def test_too_few_contacts_have_no_ranges():
    assert ContactTerms.of(rebounds(1, 14)).wall_bins(ENDS) == ()
    assert ContactTerms.of(()).bead_bins(ENDS) == ()
    assert len(ContactTerms.of(rebounds(1, 15)).wall_bins(ENDS)) == 1
