"""Sticking speeds from merges drawn from the likelihood."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.merge_likelihood import MergeRates
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle, sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import sticking_estimate
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import ONE_SIGMA, Merge, StickingStatus

BEADS = 15
CONTACTS = slow_contacts(load_trays()[1])
TIMES = np.linspace(0.0, 58.0, 1161)
SPEEDS = 7e-3 / (1.0 + TIMES / 5.0)
START = 5_000_000_000


def _cycle(rng, sticking_speed, measure='normal'):
    bodies, merges = np.empty(TIMES.size), []
    left = BEADS
    rates = CONTACTS.rate_below(sticking_speed / SPEEDS, measure) * SPEEDS * 0.5 / BEADS**0.5
    step = TIMES[1]
    for k, rate in enumerate(rates):
        bodies[k] = left
        if left > 1 and rng.random() < rate * left**1.5 * step:
            merges.append(TIMES[k])
            left -= 1
    return StickingCycle(times=TIMES, speeds=SPEEDS, bodies=bodies, merges=np.array(merges))


# Without a merge.
EMPTY = StickingCycle(
    times=TIMES, speeds=SPEEDS, bodies=np.full(TIMES.size, 15.0), merges=np.empty(0)
)


@pytest.mark.parametrize('measure', ['normal', 'total'])
def test_the_interval_has_the_stated_coverage(measure):
    rng = np.random.default_rng(1)
    estimates = [
        sticking_estimate(
            [_cycle(rng, 3e-3, measure)],
            CONTACTS,
            BEADS,
            measure=measure,
            rate_error=1e-6,
            probability=0.68,
        )
        for _ in range(40)
    ]
    held = np.mean([estimate.lower <= 3e-3 <= estimate.upper for estimate in estimates])
    assert held == pytest.approx(0.68, abs=3.0 * math.sqrt(0.68 * 0.32 / 40))
    assert np.mean([estimate.sticking_speed for estimate in estimates]) == pytest.approx(
        3e-3, rel=0.1
    )


def test_many_cycles_narrow_the_interval_down_to_the_error_of_the_theory():
    rng = np.random.default_rng(2)
    cycles = [_cycle(rng, 3e-3) for _ in range(16)]
    single, many, sure = (
        sticking_estimate(part, CONTACTS, BEADS, rate_error=error)
        for part, error in ((cycles[:1], 0.1), (cycles, 0.1), (cycles, 1e-6))
    )
    assert many.merges > 10 * single.merges
    assert single.upper - single.lower > 2.0 * (many.upper - many.lower)
    assert many.upper - many.lower > 1.2 * (sure.upper - sure.lower)
    assert many.lower < 3e-3 < many.upper


def test_the_interval_of_68_percent_is_the_one_that_is_asked_for_by_that_probability():
    rng = np.random.default_rng(2)
    for cycle in (_cycle(rng, 3e-3), _cycle(rng, 1.0), EMPTY):
        wide = sticking_estimate([cycle], CONTACTS, BEADS)
        narrow = sticking_estimate([cycle], CONTACTS, BEADS, probability=ONE_SIGMA)
        assert (wide.lower_68, wide.upper_68) == (narrow.lower, narrow.upper)
        assert wide.lower <= wide.lower_68 < wide.upper_68 <= wide.upper
        assert wide.upper_68 - wide.lower_68 < wide.upper - wide.lower


def test_without_a_merge_there_is_an_upper_limit_that_falls_with_more_cycles():
    single, many = (sticking_estimate([EMPTY] * n, CONTACTS, BEADS) for n in (1, 9))
    assert single.status is many.status is StickingStatus.NO_MERGE
    assert math.isnan(single.sticking_speed)
    assert single.lower == many.lower == 0.0
    # So few contacts are so slow: their number goes with the square of the speed.
    assert many.upper == pytest.approx(single.upper / 3.0, rel=0.1)


def test_beads_that_all_stick_at_the_start_give_no_speed():
    cycle = StickingCycle(
        times=TIMES, speeds=SPEEDS, bodies=np.ones(TIMES.size), merges=np.empty(0)
    )
    estimate = sticking_estimate([cycle], CONTACTS, BEADS, highest=0.02)
    assert estimate.status is StickingStatus.STUCK_FROM_THE_START
    assert (estimate.lower, estimate.upper) == (0.0, 0.02)
    assert math.isnan(estimate.sticking_speed)


def test_if_all_colliding_bodies_stick_there_is_only_a_lower_limit():
    estimate = sticking_estimate(
        [_cycle(np.random.default_rng(3), 1.0)], CONTACTS, BEADS, highest=0.05
    )
    assert estimate.status is StickingStatus.NO_UPPER_LIMIT
    assert estimate.upper == pytest.approx(0.05)
    assert estimate.lower > 3e-3


def test_a_lower_limit_alone_leaves_as_much_below_it_as_an_interval():
    cycle = _cycle(np.random.default_rng(3), 1.0)
    estimate = sticking_estimate([cycle], CONTACTS, BEADS, rate_error=1e-6)
    assert estimate.status is StickingStatus.NO_UPPER_LIMIT
    terms = MergeRates(CONTACTS, BEADS).terms(cycle)
    logs = terms.logs - terms.expected
    drop = logs.max() - np.interp(estimate.lower, terms.speeds, logs)
    # Half the square of the deviate of 97.5 %, within a step of the grid.
    assert drop == pytest.approx(0.5 * 1.96**2, abs=0.05)


def test_many_cycles_do_not_tell_the_error_of_the_rates():
    """Where merges are spread over time in another way than the theory says."""
    rng = np.random.default_rng(8)
    early = [
        replace(cycle, speeds=cycle.speeds * (1.0 + np.exp(-0.5 * TIMES)))
        for cycle in (_cycle(rng, 2e-3) for _ in range(60))
    ]
    singles = [sticking_estimate([cycle], CONTACTS, BEADS) for cycle in early]
    together = sticking_estimate(early, CONTACTS, BEADS)
    mean = np.mean([estimate.sticking_speed for estimate in singles])
    assert together.sticking_speed == pytest.approx(mean, rel=0.12)
    # Their error of 25 % stays, however many there are: rates go with the square of the speed.
    half_width = 0.5 * math.log(together.upper / together.lower)
    assert half_width == pytest.approx(1.96 * 0.25 / 2.0, rel=0.2)


def _merge(seconds, joins=True, known=None):
    stamp_ns = START + round(seconds * 1e9)
    return Merge(
        stamp_ns=stamp_ns,
        known_ns=stamp_ns if known is None else START + round(known * 1e9),
        tray=1,
        cycle=1,
        tracks=np.array([1, 2], dtype=np.int32),
        joins=joins,
    )


def test_a_cycle_has_the_merges_up_to_the_last_known_speed():
    stamps = START + np.arange(1, 11) * 1_000_000_000
    merges = [_merge(2.5), _merge(2.6, joins=False), _merge(4.0), _merge(11.0)]
    cycle = sticking_cycle(BEADS, merges, stamps, np.linspace(5e-3, 1e-3, 10), START)
    assert cycle.merges.tolist() == [2.5, 4.0]
    assert cycle.bodies[0] == 15.0
    assert cycle.bodies[-1] == 13.0
    assert cycle.bodies[np.searchsorted(cycle.times, 3.0)] == 14.0
    assert cycle.speeds[0] == 5e-3


def test_a_cycle_ends_where_the_path_to_know_a_merge_is_not_covered():
    # Steps of 10 mm at first, 1 mm from 6 s on: a merge is known after 15 mm.
    stamps = START + np.arange(1, 17) * 1_000_000_000
    speeds = np.where(np.arange(1, 17) < 6, 1e-2, 1e-3)
    merges = [_merge(1.0, known=2.5), _merge(2.0, known=3.5), _merge(4.0, known=5.0)]
    cycle = sticking_cycle(BEADS, merges, stamps, speeds, START)
    path_left = np.interp(16.0, [0.0, 5.0, 6.0, 16.0], [0.0, 50e-3, 55.5e-3, 65.5e-3]) - 15e-3
    assert cycle.times[-1] == 5.0
    assert 1e-2 * cycle.times[-1] <= path_left < 1e-2 * (cycle.times[-1] + 1.0)
    assert cycle.merges.tolist() == [1.0, 2.0, 4.0]


def test_the_first_merge_counts_though_others_may_be_missing():
    stamps = START + np.arange(1, 11) * 1_000_000_000
    cycle = sticking_cycle(BEADS, [_merge(3.5, known=9.5)], stamps, np.full(10, 1e-2), START)
    assert cycle.merges.tolist() == [3.5]
    assert cycle.times[-1] < 4.0 + 1e-6


def test_without_a_merge_a_cycle_ends_where_the_first_could_not_be_known_any_more():
    stamps = START + np.arange(1, 11) * 1_000_000_000
    cycle = sticking_cycle(
        BEADS, [], stamps, np.full(10, 1e-2), START, first_merge_path=30e-3 - 1e-6
    )
    assert cycle.times[-1] == 7.0
    nothing = sticking_cycle(BEADS, [], stamps, np.full(10, 1e-2), START, first_merge_path=0.2)
    assert nothing.times.tolist() == [0.0]
    estimate = sticking_estimate([nothing], CONTACTS, BEADS)
    assert estimate.status is StickingStatus.NO_MERGE
    assert math.isnan(estimate.upper)


def test_merges_that_may_have_gone_unseen_raise_the_upper_limit():
    none, two = (
        sticking_estimate([replace(EMPTY, undecided=count)], CONTACTS, BEADS, rate_error=1e-6)
        for count in (0.0, 2.0)
    )
    assert two.status is StickingStatus.NO_MERGE
    # Up to two merges of a Poisson process, with a flat prior in the sticking speed.
    speeds = np.linspace(1e-6, 0.03, 20_000)
    expected = np.interp(
        speeds,
        *(getattr(MergeRates(CONTACTS, BEADS).terms(EMPTY), n) for n in ('speeds', 'expected')),
    )
    likelihood = np.exp(-expected) * (1.0 + expected + 0.5 * expected**2)
    limit = np.interp(0.95, np.cumsum(likelihood) / likelihood.sum(), speeds)
    assert two.upper == pytest.approx(limit, rel=0.03)
    assert two.upper > 1.3 * none.upper


def test_merges_that_a_slow_gas_hides_do_not_lower_the_sticking_speed():
    rng = np.random.default_rng(4)
    path = np.append(0.0, np.cumsum(0.5 * (SPEEDS[1:] + SPEEDS[:-1]) * np.diff(TIMES)))
    stamps = START + np.rint(TIMES[1:] * 1e9).astype(np.int64)
    estimates = []
    for _ in range(40):
        merges = _cycle(rng, 2e-3).merges
        known = np.interp(merges, TIMES, path) + rng.gamma(4.0, 8e-3, merges.size)
        seen = [
            _merge(time, known=np.interp(end, path, TIMES))
            for time, end in zip(merges, known, strict=True)
            if end < path[-1]
        ]
        cycle = sticking_cycle(BEADS, seen, stamps, SPEEDS[1:], START)
        estimates.append(sticking_estimate([cycle], CONTACTS, BEADS))
    held = np.mean([estimate.lower <= 2e-3 <= estimate.upper for estimate in estimates])
    assert held > 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 40)
    values = [estimate.sticking_speed for estimate in estimates]
    assert np.nanmean(values) == pytest.approx(2e-3, rel=0.15)


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'speeds': np.zeros(TIMES.size)}, 'not positive'),
        ({'speeds': SPEEDS[:-1]}, '1160 speeds'),
        ({'times': TIMES[::-1]}, 'do not rise'),
    ],
)
def test_what_cannot_be_used_is_refused(changes, text):
    values = {'times': TIMES, 'speeds': SPEEDS, 'bodies': np.full(TIMES.size, 15.0)}
    cycle = StickingCycle(**(values | changes), merges=np.empty(0))
    with pytest.raises(FitError, match=text):
        sticking_estimate([cycle], CONTACTS, BEADS)
