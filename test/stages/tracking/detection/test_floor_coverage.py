"""The coverage of the floor shows the outline of a shaded sphere."""

from __future__ import annotations

import numpy as np
import pytest
from shaded_discs import FLOOR, Optics, draw, film, tray_of_discs
from tracking_films import match_positions

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import TrackingSettings
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector
from nanorocks_ros.stages.tracking.detection.floor_coverage import (
    FULL_COVERAGE,
    NO_COVERAGE,
    FloorCoverage,
)
from nanorocks_ros.stages.tracking.detection.pixel_classes import FLOOR as FLOOR_CLASS
from nanorocks_ros.stages.tracking.detection.pixel_classes import RED


def _shaded_patch():
    """A red patch whose light falls by two thirds, half covered pixels beside it, and floor."""
    shade = np.linspace(1.0, 0.33, 40)
    bead = shade[:, None] * np.array([45.0, 45.0, 180.0])
    half = 0.5 * bead + 0.5 * np.array(FLOOR)
    columns = [*[bead] * 30, half, *[np.broadcast_to(np.array(FLOOR), bead.shape)] * 10]
    color = np.round(np.stack(columns, axis=1)).astype(np.uint8)
    kinds = np.full(color.shape[:2], FLOOR_CLASS, dtype=np.uint8)
    kinds[:, :30] = RED
    return color, kinds


def test_shade_on_a_bead_does_not_change_the_coverage():
    color, kinds = _shaded_patch()
    background = np.broadcast_to(np.array(FLOOR, dtype=np.uint8), color.shape).copy()
    coverage = FloorCoverage(RED, (30.0, 30.0, 200.0))
    coverage.update(color, kinds)
    levels = coverage.map(color, background, np.zeros(kinds.shape, np.uint8)).astype(float)
    assert levels[:, :30] == pytest.approx(FULL_COVERAGE, abs=4.0)
    assert levels[:, 30] == pytest.approx(0.5 * (FULL_COVERAGE + NO_COVERAGE), abs=4.0)
    assert levels[:, 31:] == pytest.approx(NO_COVERAGE, abs=1.0)


def test_a_floor_of_the_colour_of_the_bead_leaves_the_darkness():
    color, kinds = _shaded_patch()
    background = np.broadcast_to(np.array([45, 45, 180], dtype=np.uint8), color.shape).copy()
    coverage = FloorCoverage(RED, (45.0, 45.0, 180.0))
    darkness = np.arange(kinds.size, dtype=np.uint32).astype(np.uint8).reshape(kinds.shape)
    assert (coverage.map(color, background, darkness) == darkness).all()


SHAPE = (136, 432)


@pytest.mark.parametrize(
    'optics',
    [
        Optics(blur=0.4, shadow=0.0, highlight=0.0, codec='none'),
        Optics(blur=0.8, ambient=0.2, shadow=0.0, highlight=0.0, codec='jpeg'),
        Optics(blur=0.8, shadow=0.0, codec='h264'),
    ],
)
def test_radii_of_shaded_spheres_are_within_a_hundredth(optics):
    centres, radii, species = tray_of_discs(3, SHAPE)
    frames = film([draw(SHAPE, centres, radii, species, optics)] * 6, optics)
    detector = BeadDetector(TrackingSettings(), load_trays()[3], 13500.0)
    for frame in frames:
        acrylic, _ = detector.detect(frame)
    true = centres[species == 0], radii[species == 0]
    rows, columns = match_positions(true[0], acrylic.positions, 3.0)
    assert rows.size == true[0].shape[0]
    assert np.median(acrylic.radii[columns] / true[1][rows]) == pytest.approx(1.0, abs=0.01)
