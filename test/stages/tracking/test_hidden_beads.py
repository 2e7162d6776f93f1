"""How many beads each one seen stands for, against places tried one by one and a drawn crowd."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.tracking.displacements import ALL_SPECIES, join_tracks
from nanorocks_ros.stages.tracking.hidden_beads import bead_weights, hidden_shares
from nanorocks_ros.stages.tracking.mean_speed import mean_speeds_of_series

FLOOR = (0.03, 0.01)
RADIUS = 5e-4
INTERVAL_NS = 100_000_000


def disc(count):
    """Points that fill a disc of radius 1 evenly, (count, 2)."""
    number = np.arange(count) + 0.5
    angle = number * np.pi * (3.0 - np.sqrt(5.0))
    return np.sqrt(number / count)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def covered_share(place, radius, places, radii):
    points = place + radius * disc(300)
    apart = np.linalg.norm(points[:, None] - places, axis=2)
    return np.mean((apart < radii).any(axis=1))


def tracks(number, positions, *, expected, errors=None):
    n = len(positions)
    return Tracks(
        stamp_ns=number * INTERVAL_NS,
        tray=1,
        ids=np.arange(n, dtype=np.int32),
        species=np.zeros(n, dtype=np.int32),
        displacement=np.array([1e-4, -2e-4]) * number,
        positions=np.asarray(positions),
        position_errors=np.full(n, 1e-6) if errors is None else errors,
        velocities=np.full((n, 2), np.nan),
        velocity_errors=np.full(n, np.nan),
        radii=np.full(n, RADIUS),
        radius_errors=np.full(n, 1e-6),
        seen=np.ones(n, dtype=bool),
        expected=np.array([expected], dtype=np.int32),
    )


def weights_of(record):
    return bead_weights(join_tracks([record]), 0, ALL_SPECIES, record.expected, FLOOR)


def test_shares_are_those_of_places_tried_one_by_one():
    random = np.random.default_rng(3)
    places = np.column_stack([random.uniform(0.0, 0.012, 60), random.uniform(0.0, 0.01, 60)])
    radii = random.choice([RADIUS, 2.0 * RADIUS], 60)
    own = np.flatnonzero(radii == RADIUS)
    shares = hidden_shares(places, radii, own, FLOOR)
    tried = []
    for place in places[own]:
        around = place + 3.0 * RADIUS * disc(300)
        limits = np.array(FLOOR) - RADIUS
        inside = around[((around > RADIUS) & (around < limits)).all(axis=1)]
        covered = [covered_share(x, RADIUS, places, radii) for x in inside]
        tried.append(np.mean(np.array(covered) > 0.7))
    assert np.ptp(tried) > 0.4
    assert np.abs(shares - tried).max() < 0.1
    assert shares.mean() == pytest.approx(np.mean(tried), abs=0.03)


def test_a_bead_alone_stands_for_itself():
    positions = [(2e-3, 2e-3), (8e-3, 5e-3), (20e-3, 7e-3)]
    weights, hidden = weights_of(tracks(0, positions, expected=5))
    # A bead hides others at its own place only, a few per cent of its surroundings.
    assert weights == pytest.approx(np.ones(3), abs=0.06)
    assert hidden < 0.06


def test_nothing_is_hidden_where_all_beads_are_seen_or_their_number_is_unknown():
    random = np.random.default_rng(5)
    positions = random.uniform((1e-3, 1e-3), (6e-3, 9e-3), (80, 2))
    for expected in (80, 78, 0):
        weights, hidden = weights_of(tracks(0, positions, expected=expected))
        assert weights.tolist() == [1.0] * 80
        assert hidden == 0.0


def crowd(random):
    """Places of a dilute gas beside a crowd; which beads show; which are in the crowd."""
    dense = random.uniform((1e-3, 1e-3), (6e-3, 9e-3), (60, 2))
    thin = random.uniform((8e-3, 1e-3), (29e-3, 9e-3), (50, 2))
    places = random.permutation(np.concatenate([dense, thin]))
    radii = np.full(len(places), RADIUS)
    # Later beads lie above earlier ones.
    shown = np.array(
        [
            covered_share(place, RADIUS, places[k + 1 :], radii[k + 1 :]) < 0.7
            for k, place in enumerate(places)
        ]
    )
    return places, shown, places[:, 0] < 7e-3


def test_a_crowd_counts_with_its_hidden_beads():
    errors, without = [], []
    for seed in range(6):
        places, shown, crowded = crowd(np.random.default_rng(seed))
        weights, hidden = weights_of(tracks(0, places[shown], expected=len(places)))
        share = np.sum(weights[crowded[shown]]) / np.sum(weights)
        errors.append(share - crowded.mean())
        without.append(crowded[shown].mean() - crowded.mean())
        assert 0.7 * (1.0 - shown.mean()) < hidden < 1.0 - shown.mean() + 1e-6
    assert np.mean(without) < -0.045
    assert abs(np.mean(errors)) < 0.02


def test_the_mean_speed_is_that_of_hidden_beads_too():
    slow, fast = 2e-4, 1e-3
    random = np.random.default_rng(2)
    places, shown, crowded = crowd(random)
    angle = random.uniform(0.0, 2.0 * np.pi, len(places))
    speed = np.where(crowded, slow, fast)
    velocity = speed[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    records = []
    for number in range(5):
        record = tracks(number, places[shown], expected=len(places))
        motion = velocity[shown] * number * INTERVAL_NS / 1e9
        # The tray moves under the beads.
        records.append(replace(record, positions=places[shown] + motion - record.displacement))
    series = join_tracks(records)
    estimates = [
        mean_speeds_of_series(
            series,
            series,
            records[0].expected,
            least_distance=5e-5,
            species=(None,),
            floor=floor,
        )[0]
        for floor in (FLOOR, None)
    ]
    true = speed.mean()
    with_hidden, of_seen = (estimate.mean_projected_speed for estimate in estimates)
    assert of_seen > 1.08 * true
    assert with_hidden == pytest.approx(true, rel=0.03)
    assert estimates[0].hidden > 0.1
    assert estimates[1].hidden == 0.0
    assert estimates[0].mean_projected_speed_error > 0.5 * (of_seen - with_hidden)


def test_usable_beads_stand_for_those_placed_badly():
    places, shown, crowded = crowd(np.random.default_rng(7))
    places, crowded = places[shown], crowded[shown]
    spoilt = crowded & (np.random.default_rng(8).random(len(places)) < 0.4)
    errors = np.where(spoilt, 1e-4, 1e-6)
    weights, _ = weights_of(tracks(0, places, expected=len(places), errors=errors))
    assert weights[spoilt].tolist() == [1.0] * np.count_nonzero(spoilt)
    good = ~spoilt
    assert np.sum(weights[good]) == pytest.approx(len(places), rel=0.01)
    share = np.sum(weights[crowded & good]) / np.sum(weights[good])
    assert share == pytest.approx(crowded.mean(), abs=0.05)
    assert crowded[good].mean() < crowded.mean() - 0.1
