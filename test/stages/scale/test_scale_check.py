"""What was told, radii, contacts and rebounds are rulers that must agree."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from contact_draws import RADIUS, drawn_collision

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Quality, Tracks
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.scale.bead_radii import measurable, radius_scale
from nanorocks_ros.stages.scale.contact_distances import contact_scale
from nanorocks_ros.stages.scale.rulers import Ruler, contradict
from nanorocks_ros.stages.scale.scale_check import ScaleCheck

TRAYS = load_trays()
TRUE = 13500.0
RATE = 30.0


def folded(places, low, high):
    """Places of beads that fly straight, folded back at both walls."""
    span = high - low
    phase = np.mod(places - low, 2.0 * span)
    return low + np.where(phase > span, 2.0 * span - phase, phase)


def flights(tray, told, *, seconds=40.0, speed=4e-3, seed=0, radius_bias=1.0, walls=True):
    """Tracks of beads that rebound from the walls, as they are measured at a scale told.

    Parameters
    ----------
    tray : Tray
        As it is.
    told : float, [px/m]
        The true scale is `TRUE`.
    """
    rng = np.random.default_rng(seed)
    species = np.concatenate(
        [np.full(kind.count, k, dtype=np.int32) for k, kind in enumerate(tray.species)]
    )
    radii = np.concatenate(
        [
            0.5 * rng.uniform(kind.diameter_low, kind.diameter_high, kind.count)
            for kind in tray.species
        ]
    )
    n, ratio = species.size, TRUE / told
    sides = np.array(tray.dimensions[:2])
    start, velocity = rng.uniform(0.0, sides, (n, 2)), rng.normal(0.0, speed, (n, 2))
    low, high = radii[:, np.newaxis], sides - radii[:, np.newaxis]
    for k in range(round(seconds * RATE)):
        path = velocity * (k / RATE) if walls else 0.01 * velocity * (k / RATE)
        places = folded(start + path, low, high) if walls else folded(start, low, high) + path
        # The crop keeps its middle where the middle of the floor is.
        middle = 0.5 * sides
        seen = middle + (places - middle + rng.normal(0.0, 6e-6, (n, 2))) * ratio
        yield Tracks(
            stamp_ns=round(k / RATE * 1e9),
            tray=tray.number,
            ids=np.arange(n, dtype=np.int32),
            species=species,
            displacement=np.zeros(2),
            positions=seen,
            position_errors=np.full(n, 6e-6),
            velocities=velocity,
            velocity_errors=np.full(n, 1e-5),
            radii=radii * ratio * radius_bias + rng.normal(0.0, 3e-6, n),
            radius_errors=np.full(n, 3e-6),
            seen=np.ones(n, dtype=np.bool_),
            expected=np.array([kind.count for kind in tray.species], dtype=np.int32),
        )


def check_of(tray, told=TRUE, **values):
    names = {'trays': (tray.number,), 'preprocess.pixels_per_metre': told, **values}
    return ScaleCheck(with_values(PipelineSettings(), names, 'test'), tray)


def checked(tray, told=TRUE, true_tray=None, values=None, **film):
    """The check and its notices after a film; `tray` is what the trays file says."""
    check = check_of(tray, told, **(values or {}))
    notices = [
        notice
        for tracks in flights(true_tray or tray, told, **film)
        for notice in check.push(tracks)
    ]
    return check, [notice.text for notice in (*notices, *check.flush())]


@pytest.mark.parametrize('number', range(1, 9))
def test_a_scale_that_is_right_is_not_called_wrong(number):
    check, texts = checked(TRAYS[number])
    assert texts == []
    assert check.flag == 0
    assert all(ruler.ratio == pytest.approx(1.0, abs=0.06) for ruler in check.rulers)


@pytest.mark.parametrize('seed', range(6))
def test_radii_that_are_too_large_by_blur_are_no_contradiction(seed):
    check, texts = checked(TRAYS[1], seed=seed, radius_bias=1.014)
    assert texts == []
    assert check.flag == 0


@pytest.mark.parametrize('number', [1, 3, 5])
@pytest.mark.parametrize('factor', [0.9, 0.95, 0.97, 1.03, 1.05, 1.1])
def test_a_wrong_scale_is_flagged_with_the_right_one(number, factor):
    check, (text,) = checked(TRAYS[number], factor * TRUE)
    assert check.flag in (Quality.WRONG_SCALE, Quality.DOUBTFUL_SCALE)
    if abs(factor - 1.0) > 0.06:
        assert check.flag is Quality.WRONG_SCALE
        assert 'no restitution is given' in text
    advised = float(text.rsplit('--preprocess-pixels-per-metre ', 1)[1])
    assert advised == pytest.approx(TRUE, rel=0.01)


@pytest.mark.parametrize('factor', [0.95, 1.05])
def test_a_wrong_diameter_is_told_from_a_wrong_scale(factor):
    (species,) = TRAYS[1].species
    own = replace(
        species,
        diameter_low=factor * species.diameter_low,
        diameter_high=factor * species.diameter_high,
    )
    check, (text,) = checked(replace(TRAYS[1], species=(own,)), true_tray=TRAYS[1])
    assert check.flag
    assert 'beads look 2.00 mm large: correct diameter_mm of tray 1' in text
    assert ('light them from all sides' in text) == (factor > 1.0)
    assert 'pixels-per-metre' not in text


def test_wrong_dimensions_are_told_from_a_wrong_scale():
    wrong = replace(TRAYS[1], dimensions=(15.9e-3, 15e-3, 3e-3))
    check, (text,) = checked(wrong, true_tray=TRAYS[1])
    assert check.flag
    lengths = re.search(r'looks (\S+) mm along columns and (\S+) mm along rows: correct dim', text)
    assert [float(length) for length in lengths.groups()] == pytest.approx([15.0, 15.0], abs=0.06)


def test_beads_that_reach_no_wall_tell_the_scale_by_their_radii_alone():
    check, (text,) = checked(TRAYS[1], 1.08 * TRUE, walls=False)
    assert {ruler.source for ruler in check.rulers} == {'told', 'beads'}
    assert 'the beads alone support 13' in text
    assert 'if diameter_mm of tray 1 in the trays file is right' in text


def test_a_region_that_does_not_fit_the_scale_is_told_before_any_bead_is():
    check = check_of(TRAYS[1], **{'preprocess.regions_px': (0, 0, 240, 202)})
    assert check.flag is Quality.WRONG_SCALE
    (notice,) = check.flush()
    assert 'the region along columns 16000 px/m (+18.5 %)' in notice.text


def test_a_region_that_beads_and_walls_contradict_gets_its_size():
    values = {'preprocess.regions_px': (0, 0, 222, 222)}
    check, (text,) = checked(TRAYS[1], values=values)
    assert check.flag is Quality.WRONG_SCALE
    assert 'give a region of 20' in text


def test_the_notice_comes_once_and_the_flag_early():
    check = check_of(TRAYS[1], 1.09 * TRUE)
    stamps, notices = [], []
    for tracks in flights(TRAYS[1], 1.09 * TRUE, seconds=30.0):
        notices += check.push(tracks)
        stamps += [tracks.stamp_ns] if check.flag else []
    assert stamps[0] < 2_000_000_000
    assert len([*notices, *check.flush()]) == 1


def test_trays_that_were_found_elsewhere_get_no_second_notice():
    check = check_of(TRAYS[1], 1.09 * TRUE)
    notices = []
    for tracks in flights(TRAYS[1], 1.09 * TRUE, seconds=30.0):
        notices += check.push(replace(tracks, quality=Quality.WRONG_SCALE))
    assert [*notices, *check.flush()] == []
    assert check.flag


def test_time_that_goes_back_starts_the_check_afresh():
    check = check_of(TRAYS[1], 1.09 * TRUE)
    for tracks in flights(TRAYS[1], 1.09 * TRUE, seconds=5.0):
        check.push(tracks)
    assert check.flag
    check.push(next(iter(flights(TRAYS[1], TRUE, seconds=1.0))))
    assert check.flag == 0


@pytest.mark.parametrize('ratio', [0.94, 0.97, 1.0, 1.03])
def test_distances_at_contact_tell_the_scale(ratio):
    rng = np.random.default_rng(3)
    pairs = [drawn_collision(rng, 0.9) for _ in range(60)]
    distances = np.array([math.hypot(*pair.separation) / (2.0 * RADIUS) for pair in pairs])
    scale, error = contact_scale(ratio * distances, np.full(60, 0.003), 0.5)
    assert abs(scale - ratio) < 3.0 * error
    assert error < 0.01


def test_few_contacts_tell_nothing():
    assert contact_scale(np.full(8, 0.99), np.full(8, 0.003), 0.5) is None


def test_contacts_of_beads_that_pass_over_each_other_are_not_used():
    check = check_of(TRAYS[5])
    for pair in (drawn_collision(np.random.default_rng(1), 0.9) for _ in range(20)):
        check.push(pair)
    check.flush()
    assert {ruler.source for ruler in check.rulers} == {'told'}


def test_radii_under_chalk_and_of_grains_are_not_compared():
    usable = {
        number: [measurable(tray, species) for species in tray.species]
        for number, tray in TRAYS.items()
    }
    assert usable == {
        1: [True],
        2: [False, False],
        3: [True, True],
        4: [False, False],
        5: [True, True],
        6: [False, False],
        7: [True, False],
        8: [False],
    }


def test_radii_of_a_range_are_limits():
    species = TRAYS[5].species[0]
    rng = np.random.default_rng(0)
    radii = 0.5 * rng.uniform(species.diameter_low, species.diameter_high, 400)
    scale, error = radius_scale(species, radii, 0.01 * radii, 10)
    assert abs(scale - 1.0) < 2.0 * error
    assert radius_scale(species, radii[:100], 0.01 * radii[:100], 10) is None


def test_radii_with_large_stated_errors_contradict_nothing():
    """Highlights made glass of 4 px 12 % large, and the scale of the film was refused."""
    species = TRAYS[1].species[0]
    radii = np.full(10 * species.count, 0.56 * species.diameter)
    scale, error = radius_scale(species, radii, 0.06 * radii, 10)
    told = Ruler(name='told', source='told', ratio=1.0, error=1e-6)
    measured = Ruler(name='radii', source='beads', ratio=scale, error=error)
    assert scale == pytest.approx(1.12)
    assert not contradict(told, measured)
    scale, error = radius_scale(species, radii, 0.005 * radii, 10)
    assert contradict(told, Ruler(name='radii', source='beads', ratio=scale, error=error))
