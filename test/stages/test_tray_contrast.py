"""What is taken out of a tray image before its autocorrelation."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.stages.tray_contrast import tray_contrast


def test_a_slope_of_the_light_leaves_nothing():
    rows, columns = np.mgrid[:60, :90]
    found = tray_contrast((100 + rows + columns // 2).astype(np.uint8), halve=False)
    assert np.abs(found).max() < 0.6


def test_glare_leaves_nothing_and_does_not_tilt_the_rest():
    gray = np.full((80, 80), 120, np.uint8)
    gray[10:30, 40:70] = 255
    found = tray_contrast(gray, halve=True)
    assert found == pytest.approx(np.zeros((40, 40)), abs=1e-3)


def test_half_the_resolution_takes_means_of_four():
    gray = np.random.default_rng(0).integers(50, 200, (41, 61), dtype=np.uint8)
    found = tray_contrast(gray, halve=True)
    means = cv2.resize(gray[:40, :60].astype(np.float32), (30, 20), interpolation=cv2.INTER_AREA)
    rows, columns = np.mgrid[:20, :30]
    design = np.stack([np.ones(600), rows.ravel(), columns.ravel()], axis=1)
    plane = design @ np.linalg.lstsq(design, means.ravel(), rcond=None)[0]
    assert found == pytest.approx(means - plane.reshape(20, 30), abs=1e-3)


@pytest.mark.parametrize('shape', [(1, 1), (1, 9), (7, 1)])
@pytest.mark.parametrize('level', [90, 255])
def test_the_smallest_images_and_those_all_glare_are_no_trouble(shape, level):
    found = tray_contrast(np.full(shape, level, np.uint8), halve=True)
    assert np.abs(found).max() < 1e-3
