"""Likelihood of merges against the integral itself, and for a growing cycle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

from benchmarks.sticking import true_merges
from benchmarks.turning_gas import RATE, Gas, pictures
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.merge_likelihood import MergeRates
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle, sticking_cycle
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import Merge

BEADS = 15
CONTACTS = slow_contacts(load_trays()[1])
NS = 1_000_000_000
STAMPS = np.arange(1, 900, dtype=np.int64) * NS // 15
SPEEDS = 7e-3 / (1.0 + STAMPS / (5 * NS)) * np.exp(0.05 * np.sin(STAMPS / NS))


def merges(*times):
    return [
        Merge(
            stamp_ns=round(time * NS),
            known_ns=round((time + 1.0) * NS),
            tray=1,
            cycle=1,
            tracks=np.array([1, 2], dtype=np.int32),
            joins=True,
        )
        for time in times
    ]


def cycle(until, *times):
    used = until * NS >= STAMPS
    return sticking_cycle(BEADS, merges(*times), STAMPS[used], SPEEDS[used], 0)


def test_the_likelihood_has_the_integral_of_the_rates_and_their_logarithms_at_the_merges():
    decay = cycle(50.0, 20.0, 31.5)
    terms = MergeRates(CONTACTS, BEADS).terms(decay)
    slower = CONTACTS.interpolated_rate_below(terms.speeds[:, np.newaxis] / decay.speeds)
    # Bodies are wider than beads, as the root of their mean size.
    rates = slower * decay.speeds * 0.5 * decay.bodies**1.5 / BEADS**0.5
    np.testing.assert_allclose(terms.expected, trapezoid(rates, decay.times), rtol=1e-12)
    speeds = np.interp(decay.merges, decay.times, decay.speeds)
    slower = CONTACTS.interpolated_rate_below(terms.speeds[:, np.newaxis] / speeds)
    np.testing.assert_allclose(terms.logs, np.log(slower * speeds).sum(axis=1), rtol=1e-12)
    assert terms.merges == 2


@pytest.mark.parametrize(
    'steps',
    [
        [(10.0,), (11.0,), (12.0, 11.9), (30.0, 11.9), (59.0, 11.9, 40.0)],
        # A merge long ago that nobody knew of, and another cycle altogether.
        [(30.0,), (31.0, 5.0), (8.0,), (32.0, 5.0, 31.0)],
    ],
)
def test_a_growing_cycle_has_the_likelihood_of_the_whole_cycle(steps):
    growing = MergeRates(CONTACTS, BEADS)
    for until, *times in steps:
        terms, afresh = (
            rates.terms(cycle(until, *times)) for rates in (growing, MergeRates(CONTACTS, BEADS))
        )
        np.testing.assert_allclose(terms.expected, afresh.expected, rtol=1e-13)
        np.testing.assert_array_equal(terms.logs, afresh.logs)


def test_cycles_add_up_and_a_single_body_does_not_contribute():
    rates = MergeRates(CONTACTS, BEADS)
    first, second = rates.terms(cycle(30.0, 20.0)), rates.terms(cycle(50.0))
    stuck = StickingCycle(
        times=np.array([0.0, 1.0]),
        speeds=np.ones(2),
        bodies=np.ones(2),
        merges=np.empty(0),
    )
    alone = rates.terms(stuck)
    assert not alone.exposed
    total = first + second + alone
    assert (total.merges, total.exposed) == (1, True)
    np.testing.assert_array_equal(total.expected, first.expected + second.expected)


def _turning_cycle(tray, sticking, seed):
    """A cycle of the independent gas, up to a quarter of the bodies, with its true merges."""
    rows = []
    for frame in pictures(tray, Gas(0.89, sticking=sticking), seed, round(20 * RATE)):
        speed = np.hypot(*frame.tracks.velocities.T).mean()
        rows.append((frame.tracks.stamp_ns, np.unique(frame.bodies).size, speed))
        if rows[-1][1] < 0.25 * tray.count:
            break
    stamps, bodies, speeds = np.array(rows).T
    merges = true_merges(stamps / NS, bodies, tray.count)
    return sticking_cycle(tray.count, merges, stamps[1:].astype(np.int64), speeds[1:], 0)


def test_bodies_of_an_independent_gas_merge_as_often_as_expected():
    tray, sticking = load_trays()[3], 3e-3
    rates = MergeRates(slow_contacts(tray), tray.count)
    cycles = [_turning_cycle(tray, sticking, seed) for seed in range(4)]
    merges, expected = 0, 0.0
    for cycle in cycles:
        terms = rates.terms(cycle)
        merges += terms.merges
        expected += np.interp(sticking, terms.speeds, terms.expected)
    assert merges > 150
    # Two standard deviations; bodies as wide as beads would merge 0.76 times as often.
    assert expected == pytest.approx(merges, rel=2.0 / np.sqrt(merges))
