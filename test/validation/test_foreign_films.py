"""Films by other code, imported and analysed as a user does it: right, or flagged."""

import numpy as np
import pytest
from shared_films import foreign_film

from benchmarks.film_measurement import is_flagged, measure
from benchmarks.film_truth import read_truth
from nanorocks_ros.records import CorStatus, Headline, Quality


def measured(name):
    film = read_truth(foreign_film(name))
    result = measure(film)
    assert result.refusal == ''
    return film, result


def test_true_velocities_are_in_space_above_a_plate_that_swings():
    film = read_truth(foreign_film('p3a'))
    # Between two contacts a bead keeps its velocity; past the plate it would not.
    assert np.median(np.abs(np.diff(film.velocities, axis=0))) == 0.0


def within_three_sigma(interval, truth):
    """Whether the truth is within three standard deviations, by an interval of 95 %."""
    return abs(interval.value - truth) <= 3.0 * (interval.upper - interval.lower) / (2.0 * 1.96)


# Ordinary H.264 with key frames, and a camera that jitters by 2 px.
@pytest.mark.parametrize('name', ['a1_75_95k', 'b1_jitter'])
def test_a_codec_and_a_camera_that_jitters_leave_one_cycle_and_its_restitution(name):
    film, result = measured(name)
    (cycle,) = result.cycles
    assert cycle.status is CorStatus.FINAL
    assert not is_flagged(cycle)
    assert within_three_sigma(cycle.restitution, film.beads)
    assert within_three_sigma(cycle.wall_restitution, film.walls)
    assert result.speed_ratios[1:] == pytest.approx([1.0] * 3, abs=0.04)
    assert result.counts == pytest.approx((1.0,), abs=0.03)
    assert result.radii == pytest.approx((1.0,), abs=0.006)


def test_clusters_that_turn_are_not_taken_for_a_gas():
    """Contacts of free beads tell the restitutions; the decay counts until the first merge."""
    film, result = measured('s1_turn')
    (cycle,) = result.cycles
    assert cycle.quality & Quality.STICKING
    assert cycle.headline is Headline.CONTACTS
    for interval, truth in (
        (cycle.wall_restitution, film.walls),
        (cycle.restitution, film.beads),
    ):
        assert interval.lower <= truth <= interval.upper
