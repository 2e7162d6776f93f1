"""A lone bead that is struck keeps its number; where it is not clear which one, nobody guesses."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.linking.link_probabilities import DetectedBeads, KnownBeads
from nanorocks_ros.stages.tracking.linking.struck_beads import link_struck_beads

INTERVAL = 1.0 / 30.0


def known(places, elapsed=INTERVAL):
    count = len(places)
    places = np.array(places, dtype=float)
    times = np.full(count, elapsed)
    return KnownBeads(places, np.ones(count), places, times, np.full(count, 10.0))


def detected(places, radius=10.0):
    count = len(places)
    values = np.full(count, 0.1)
    return DetectedBeads(np.array(places, float), values, np.full(count, radius), values)


def linked(beads, discs, links, *, max_speed=1500.0):
    return link_struck_beads(np.array(links), beads, discs, max_speed).tolist()


def test_a_bead_struck_from_rest_keeps_its_number():
    beads, discs = known([(50, 50), (200, 50)]), detected([(200, 50), (75, 60)])
    assert linked(beads, discs, [-1, 0]) == [1, 0]


def test_nothing_faster_than_the_limit_is_linked():
    beads, discs = known([(50, 50)]), detected([(75, 60)])
    assert linked(beads, discs, [-1], max_speed=600.0) == [-1]


@pytest.mark.parametrize(
    ('places', 'discs'),
    [([(50, 50)], [(75, 50), (22, 50)]), ([(50, 50), (100, 50)], [(76, 50)])],
)
def test_two_that_are_about_as_near_are_not_linked(places, discs):
    assert linked(known(places), detected(discs), [-1] * len(places)) == [-1] * len(places)


def test_a_disc_of_another_size_is_another_bead():
    assert linked(known([(50, 50)]), detected([(75, 60)], radius=15.0), [-1]) == [-1]


def test_a_bead_lost_long_ago_is_not_linked():
    beads = known([(50, 50), (200, 50)])
    beads.elapsed[0] = 20.0 * INTERVAL
    assert linked(beads, detected([(200, 50), (75, 60)]), [-1, 0]) == [-1, 0]


def test_without_beads_or_discs_links_stay():
    empty = np.empty((0, 2))
    assert linked(known(empty), detected(empty), np.empty(0, np.int64)) == []
