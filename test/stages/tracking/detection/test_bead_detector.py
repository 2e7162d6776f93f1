"""Beads detected in single images against the positions they were drawn at."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from shaded_discs import Optics, draw, film
from tracking_films import SCALE, match_positions, tray_film

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import TrackingSettings
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector


def _errors(number, index, frames=24, clear=0.8):
    """Errors of position and radius of unobstructed beads, [px]; share of beads found."""
    detector = BeadDetector(TrackingSettings(), load_trays()[number], SCALE)
    position_errors, radius_errors, n_found, n_true = [], [], 0, 0
    for image, truth in tray_film(number, frames):
        detections = detector.detect(image.color)[index]
        is_species = truth.species == index
        positions, radii = truth.positions[is_species, :2] * SCALE, truth.radii[is_species] * SCALE
        rows, columns = match_positions(positions, detections.positions, 0.6 * radii.min())
        n_found, n_true = n_found + rows.size, n_true + is_species.sum()
        is_clear = detections.visible_outline[columns] >= clear
        position_errors.append((detections.positions[columns] - positions[rows])[is_clear])
        radius_errors.append((detections.radii[columns] - radii[rows])[is_clear])
    return np.concatenate(position_errors), np.concatenate(radius_errors), n_found / n_true


def test_a_free_bead_of_25_px_is_placed_within_a_twentieth_of_a_pixel():
    position_errors, radius_errors, share = _errors(1, 0)
    assert share == 1.0
    assert np.sqrt(np.mean(position_errors**2)) < 0.05
    assert np.abs(radius_errors).max() < 0.15


def test_a_free_bead_of_12_px_beside_large_ones_is_placed_within_a_tenth_of_a_pixel():
    position_errors, _, share = _errors(3, 1)
    assert share > 0.93
    assert np.quantile(np.abs(position_errors), 0.9) < 0.1


def test_the_radius_of_each_bead_is_measured_in_a_species_of_many_sizes():
    position_errors, radius_errors, share = _errors(5, 1)
    assert share > 0.9
    assert np.median(np.abs(radius_errors)) < 0.25
    assert np.median(np.abs(position_errors)) < 0.1


def _blurred_beads(places, blur):
    """Image of flat discs of tray 1 at places (n, 2) [px] through a lens with some blur [px]."""
    acrylic = load_trays()[1].species[0]
    rows, columns = (axis / 8.0 for axis in np.ogrid[0.5 : 188 * 8, 0.5 : 188 * 8])
    covered = np.zeros((188 * 8, 188 * 8), dtype=np.float32)
    for x, y in places:
        covered[np.hypot(columns - x, rows - y) < 0.5 * acrylic.diameter * SCALE] = 1.0
    covered = cv2.GaussianBlur(covered, (0, 0), 8.0 * blur)
    share = cv2.resize(covered, (188, 188), interpolation=cv2.INTER_AREA)[:, :, np.newaxis]
    image = 150.0 + share * (np.array(acrylic.properties.color) * 0.8 - 150.0)
    return image.round().astype(np.uint8)


@pytest.mark.parametrize('gap', [2.0, 3.0, 4.0])
def test_a_bead_that_is_near_does_not_push_another_away(gap):
    radius = 0.5 * load_trays()[1].species[0].diameter * SCALE
    distance = 2.0 * radius + gap
    rng = np.random.default_rng(4)
    errors = []
    for angle in rng.uniform(0.0, np.pi, 8):
        step = 0.5 * distance * np.array([np.cos(angle), np.sin(angle)])
        middle = 94.0 + rng.uniform(-0.5, 0.5, 2)
        detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
        image = _blurred_beads([middle - step, middle + step], 1.0)
        positions = detector.detect(image)[0].positions
        assert len(positions) == 2
        errors.append(np.hypot(*(positions[1] - positions[0])) - distance)
    assert np.mean(errors) == pytest.approx(0.0, abs=0.06)


def test_an_empty_tray_has_no_detections():
    rng = np.random.default_rng(3)
    floor = np.clip(rng.normal(150.0, 3.0, (188, 188, 3)), 0, 255).astype(np.uint8)
    detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
    assert detector.detect(floor)[0].radii.size == 0


@pytest.mark.parametrize('level', [0, 255])
def test_a_black_or_white_image_has_no_detections(level):
    image = np.full((188, 188, 3), level, dtype=np.uint8)
    detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
    assert detector.detect(image)[0].radii.size == 0


def test_light_that_fades_by_a_third_loses_no_bead():
    detector = BeadDetector(TrackingSettings(), load_trays()[1], SCALE)
    for k, (image, truth) in enumerate(tray_film(1, 90)):
        dimmed = (image.color * (1.0 - 0.33 * k / 90.0)).astype(np.uint8)
        detections = detector.detect(dimmed)[0]
        rows, _ = match_positions(truth.positions[:, :2] * SCALE, detections.positions, 3.0)
        assert rows.size == 15


def test_crowded_grains_are_not_detected():
    detector = BeadDetector(TrackingSettings(), load_trays()[6], SCALE)
    image, _ = next(tray_film(6, 1))
    glass, grains = detector.detect(image.color)
    assert glass.radii.size > 10
    assert grains.radii.size == 0


@pytest.mark.parametrize('gap', [1.5, 2.5, 3.5])
def test_a_bead_beside_another_is_not_displaced_by_it(gap):
    """Outlines of neighbours that were taken for floor pushed beads 0.1 px away from them."""
    shape, radius = (160, 640), 13.5
    rng = np.random.default_rng(5)
    angles = np.linspace(0.0, np.pi, 7, endpoint=False)
    middles = np.column_stack([50.0 + 90.0 * np.arange(7), np.full(7, 80.0)]) + rng.random((7, 2))
    apart = (radius + 0.5 * gap) * np.column_stack([np.cos(angles), np.sin(angles)])
    centres = np.concatenate([middles - apart, middles + apart])
    optics = Optics(shadow=0.0, codec='none')
    picture = draw(shape, centres, np.full(14, radius), np.zeros(14, int), optics)
    detector = BeadDetector(TrackingSettings(), load_trays()[1], 13500.0)
    for frame in film([picture] * 6, optics):
        places = detector.detect(frame)[0].positions
    rows, columns = match_positions(centres, places, 3.0)
    assert rows.size == 14
    away = (places[columns] - centres[rows]) * np.concatenate([-apart, apart])[rows]
    assert abs(np.mean(away.sum(axis=1)) / np.hypot(*apart[0])) < 0.03
