"""Radii of blurred and shaded spheres from the mean profiles of their outlines."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from shaded_discs import Optics, draw, film, tray_of_discs
from tracking_films import match_positions

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import TrackingSettings
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector
from nanorocks_ros.stages.tracking.detection.blurred_discs import blurred_disc, edge_biases

SHAPE = (136, 432)


def _relative_errors(optics):
    """Mean relative errors of the radii of acrylic and of glass, after eight frames."""
    centres, radii, species = tray_of_discs(3, SHAPE)
    frames = film([draw(SHAPE, centres, radii, species, optics)] * 8, optics)
    detector = BeadDetector(TrackingSettings(), load_trays()[3], 13500.0)
    for frame in frames:
        detections = detector.detect(frame)
    errors = []
    for kind, beads in enumerate(detections):
        true_centres, true_radii = centres[species == kind], radii[species == kind]
        rows, columns = match_positions(true_centres, beads.positions, 3.0)
        assert rows.size >= 0.95 * true_radii.size
        errors.append((beads.radii[columns] / true_radii[rows]).mean() - 1.0)
    return errors


@pytest.mark.parametrize(
    'optics',
    [
        Optics(blur=0.3, shadow=0.0, highlight=0.0, codec='none'),
        Optics(blur=0.8, shadow=0.0, codec='h264'),
        Optics(blur=0.8, shadow=0.0, highlight=60.0, bayer=True, codec='none'),
    ],
    ids=['sharp', 'h264', 'bayer'],
)
def test_blur_shade_and_highlights_do_not_change_radii(optics):
    assert np.abs(_relative_errors(optics)).max() < 0.004


def test_the_picture_of_a_disc_behind_a_gaussian_is_that_of_a_filter():
    fine, radius, width = 20, 6.0, 1.3
    side = np.arange(-14 * fine, 14 * fine + 1) / fine
    disc = (np.hypot(*np.meshgrid(side, side)) <= radius).astype(np.float64)
    blurred = cv2.GaussianBlur(disc, (0, 0), width * fine)
    distances = np.array([0.0, 3.0, 5.0, 6.0, 7.5, 9.0])
    expected = blurred[14 * fine, np.rint((14.0 + distances) * fine).astype(int)]
    levels = blurred_disc(distances, np.full(distances.shape, radius), width)
    assert levels == pytest.approx(expected, abs=0.004)


def test_blur_moves_the_edge_of_a_large_disc_by_its_variance_over_the_diameter():
    # Within 3 px, as of beads of this size; the curvature of the fourth column is 1 / 21 px.
    variance, column = 0.5, 3
    bias = edge_biases(variance)[1, column]
    curvature = 0.5 * column / 32
    assert bias == pytest.approx(-0.5 * variance * curvature, rel=0.1)
