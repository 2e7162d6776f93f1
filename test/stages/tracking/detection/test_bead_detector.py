"""Beads in single pictures against where they were drawn."""

from __future__ import annotations

import numpy as np
import pytest
from tracking_films import SCALE, paired, tray_film

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import TrackingSettings
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector


def _errors(number, index, frames=24, clear=0.8):
    """Of the beads whose outline is seen: place and radius less the truth, [px]; share found."""
    detector = BeadDetector(TrackingSettings(), load_trays()[number], SCALE)
    apart, sizes, found, true = [], [], 0, 0
    for image, truth in tray_film(number, frames):
        one = detector.detect(image.color)[index]
        own = truth.species == index
        places, radii = truth.positions[own, :2] * SCALE, truth.radii[own] * SCALE
        rows, columns = paired(places, one.places, 0.6 * radii.min())
        found, true = found + rows.size, true + own.sum()
        free = one.outline_seen[columns] >= clear
        apart.append((one.places[columns] - places[rows])[free])
        sizes.append((one.radii[columns] - radii[rows])[free])
    return np.concatenate(apart), np.concatenate(sizes), found / true


def test_a_free_bead_of_25_px_is_placed_within_a_twentieth_of_a_pixel():
    apart, sizes, found = _errors(1, 0)
    assert found == 1.0
    assert np.sqrt(np.mean(apart**2)) < 0.05
    assert np.abs(sizes).max() < 0.15


def test_a_free_bead_of_12_px_beside_large_ones_is_placed_within_a_tenth_of_a_pixel():
    apart, _, found = _errors(3, 1)
    assert found > 0.93
    assert np.quantile(np.abs(apart), 0.9) < 0.1


def test_beads_of_all_sizes_get_a_size_of_their_own():
    apart, sizes, found = _errors(5, 1)
    assert found > 0.9
    assert np.median(np.abs(sizes)) < 0.25
    assert np.median(np.abs(apart)) < 0.1


def test_no_bead_is_seen_in_an_empty_tray():
    rng = np.random.default_rng(3)
    floor = np.clip(rng.normal(150.0, 3.0, (188, 188, 3)), 0, 255).astype(np.uint8)
    detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
    assert detector.detect(floor)[0].radii.size == 0


@pytest.mark.parametrize('level', [0, 255])
def test_a_black_or_white_picture_shows_no_bead_and_is_no_error(level):
    picture = np.full((188, 188, 3), level, dtype=np.uint8)
    detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
    assert detector.detect(picture)[0].radii.size == 0


def test_light_that_fades_by_a_third_loses_no_bead():
    detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
    for k, (image, truth) in enumerate(tray_film(1, 90)):
        dimmed = (image.color * (1.0 - 0.33 * k / 90.0)).astype(np.uint8)
        one = detector.detect(dimmed)[0]
        rows, _ = paired(truth.positions[:, :2] * SCALE, one.places, 3.0)
        assert rows.size == 15


def test_grains_too_many_to_be_told_apart_are_left_alone():
    detector = BeadDetector(TrackingSettings(), load_trays()[6], SCALE)
    image, _ = next(tray_film(6, 1))
    glass, grains = detector.detect(image.color)
    assert glass.radii.size > 10
    assert grains.radii.size == 0
