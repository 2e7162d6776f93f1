"""The posterior of a restitution by a law of the impact speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import drawn_rebound

from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.restitution_law import RestitutionLaw, law_posterior

ENDS = np.array([0.025, 0.5, 0.975])
REFERENCE = 3e-3
SPEEDS = np.array([1e-3, 2e-3, 4e-3, 8e-3])


def law(speed, value=0.8, exponent=0.5):
    return np.maximum(1.0 - (1.0 - value) * (speed / REFERENCE) ** exponent, 0.0)


def known(value=0.8, exponent=0.5, bias=0.0):
    return RestitutionLaw(
        speed=REFERENCE,
        restitutions=np.array([value]),
        exponents=np.array([exponent]),
        probabilities=np.ones(1),
        bias=bias,
        impact_speeds=SPEEDS,
    )


class Contacts:
    """Contacts whose likelihood is not asked for."""

    speeds, reference, gain = SPEEDS, REFERENCE, 0.0


def gaussian(value, exponent, deviations, biases=(0.0, 0.0)):
    """The posterior of a likelihood that is a Gaussian of both unknowns."""
    grid = value + deviations[0] * np.linspace(-5.0, 5.0, 16), np.linspace(-1.0, 2.0, 31)
    squares = [
        ((axis - centre) / deviation) ** 2
        for axis, centre, deviation in zip(grid, (value, exponent), deviations, strict=True)
    ]
    logs = -0.5 * np.add.outer(*squares)
    return law_posterior(grid, logs, Contacts, biases)


def test_a_known_law_gives_its_restitution_at_every_speed():
    for speed in SPEEDS:
        assert known().at(speed).mean == pytest.approx(law(speed), abs=1e-9)
    assert known(0.2, 2.0).at(1.0).mean == 0.0


def test_the_energy_weighted_restitution_loses_what_the_contacts_lose():
    mean = known().energy_weighted.mean
    lost = np.sum((1.0 - law(SPEEDS) ** 2) * SPEEDS**2)
    assert (1.0 - mean**2) * np.sum(SPEEDS**2) == pytest.approx(lost, rel=1e-9)
    # Fast contacts lose more, and most of the energy.
    assert mean < known().at(float(SPEEDS.mean())).mean


def test_speeds_of_collisions_follow_from_the_law_itself():
    # Seen is the impact speed times 1 + restitution, over a mean gain.
    gain = 1.85
    seen = SPEEDS * (1.0 + law(SPEEDS)) / gain
    mean = replace(known(), impact_speeds=seen, gain=gain).energy_weighted.mean
    assert mean == pytest.approx(known().energy_weighted.mean, abs=2e-3)
    assert abs(replace(known(), impact_speeds=seen).energy_weighted.mean - mean) > 5e-3


def test_a_law_may_be_limited_to_some_exponents():
    posterior = gaussian(0.8, 0.5, (0.01, 0.2))
    limited = posterior.up_to(0.4)
    assert 0.0 <= limited.exponents.min() <= limited.exponents.max() <= 0.4
    assert limited.probabilities.sum() == pytest.approx(1.0)
    assert gaussian(0.8, -0.8, (0.01, 0.02)).up_to(0.4) is None


def test_a_correction_scales_the_losses_and_adds_its_error():
    corrected = known().corrected(0.5, 0.01)
    assert corrected.at(REFERENCE).mean == pytest.approx(0.9, abs=1e-4)
    assert corrected.at(REFERENCE).deviation == pytest.approx(0.01, rel=0.02)


def test_of_a_constant_law_both_are_the_constant():
    constant = gaussian(0.8, 0.0, (0.01, 1e-2))
    for posterior in (constant.at(REFERENCE), constant.energy_weighted):
        assert posterior.mean == pytest.approx(0.8, abs=2e-3)
        assert posterior.deviation == pytest.approx(0.01, rel=0.1)


def test_the_band_is_narrowest_at_the_reference_speed():
    posterior = gaussian(0.8, 0.5, (0.01, 0.1))
    assert posterior.at(REFERENCE).deviation == pytest.approx(0.01, rel=0.05)
    speed = 3.0 * REFERENCE
    slope = 0.2 * math.sqrt(3.0) * math.log(3.0)
    expected = math.hypot(0.01 * math.sqrt(3.0), slope * 0.1)
    assert posterior.at(speed).deviation == pytest.approx(expected, rel=0.1)
    lower, middle, upper = posterior.at(speed).quantiles(ENDS)
    assert lower < law(speed) < upper
    assert middle == pytest.approx(law(speed), abs=0.01)


@pytest.mark.parametrize(('deviation', 'bias'), [(0.01, 0.01), (0.001, 0.02)])
def test_a_systematic_error_adds_to_every_restitution(deviation, bias):
    posterior = gaussian(0.8, 0.5, (deviation, 0.01), (bias, 0.0))
    assert posterior.at(REFERENCE).deviation == pytest.approx(
        math.hypot(deviation, bias), rel=0.05
    )
    assert posterior.at(REFERENCE).mean == pytest.approx(0.8, abs=2e-3)


def test_a_systematic_error_of_the_exponent_widens_the_exponent_alone():
    sure, unsure = (gaussian(0.8, 0.5, (0.01, 0.1), (0.0, bias)) for bias in (0.0, 0.1))

    def deviation(posterior):
        mean = posterior.probabilities @ posterior.exponents
        return math.sqrt(posterior.probabilities @ (posterior.exponents - mean) ** 2)

    assert deviation(unsure) == pytest.approx(math.sqrt(2.0) * deviation(sure), rel=0.05)
    assert unsure.at(REFERENCE).deviation == pytest.approx(0.01, rel=0.05)


def test_rebounds_give_the_law_that_they_were_drawn_with():
    misses = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        speeds = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), 150))
        noise = rng.normal(0.0, 0.02, (150, 2))
        rebounds = [
            drawn_rebound(speed * (1 + first), speed * (law(speed) + second), 0.02 * speed)
            for speed, (first, second) in zip(speeds, noise, strict=True)
        ]
        fitted = ContactTerms.of(rebounds).wall_exponent().law
        truth = math.sqrt(np.sum((law(speeds) * speeds) ** 2) / np.sum(speeds**2))
        for value, posterior in (
            (truth, fitted.energy_weighted),
            (law(fitted.speed), fitted.at(fitted.speed)),
        ):
            lower, _, upper = posterior.quantiles(ENDS)
            misses.append(not lower <= value <= upper)
            assert upper - lower < 0.04
    assert np.mean(misses) < 0.15
