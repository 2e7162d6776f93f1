"""What is taken out of a tray image before its autocorrelation."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.stages.clusters.background_removal import tray_contrast


def beads(light=150, bead=50):
    gray = np.full((120, 120), light, np.uint8)
    for place in (25, 60, 95):
        cv2.circle(gray, (place, place), 12, bead, -1)
    return gray


def test_a_slope_of_the_light_leaves_hardly_anything():
    rows, columns = np.mgrid[:60, :90]
    contrast = tray_contrast((100 + rows + columns // 2).astype(np.uint8), halve=False)
    assert np.abs(contrast).max() < 1.5


def test_the_floor_is_even_and_beads_are_dark():
    contrast = tray_contrast(beads(), halve=False)
    dark = beads() == 50
    assert not contrast[~dark].any()
    # Of 100 levels, a quarter is taken for shadow; less what the plane takes.
    assert contrast[dark].mean() == pytest.approx(-75.0, abs=5.0)


def test_shadows_and_a_lamp_to_one_side_change_little():
    plain, shaded = beads(), beads().astype(float)
    rows, columns = np.mgrid[:120, :120]
    for place in (25, 60, 95):
        near = np.hypot(columns - place - 6, rows - place - 6) < 14
        shaded[near & (plain == 150)] *= 0.88
    shaded *= 1.0 - 0.1 * columns / 120.0
    contrast = tray_contrast(shaded.astype(np.uint8), halve=False)
    assert np.abs(contrast - tray_contrast(plain, halve=False)).mean() < 2.0
    assert (contrast < 0.0).mean() == pytest.approx((plain == 50).mean(), rel=0.05)


def test_glare_leaves_nothing_and_does_not_tilt_the_rest():
    gray = np.full((80, 80), 120, np.uint8)
    gray[10:30, 40:70] = 255
    contrast = tray_contrast(gray, halve=True)
    assert contrast == pytest.approx(np.zeros((40, 40)), abs=1.0)


def test_half_the_resolution_takes_means_of_four():
    gray = cv2.GaussianBlur(beads(), (0, 0), 2.0)
    contrast = tray_contrast(gray, halve=True)
    fine = tray_contrast(gray, halve=False)
    means = cv2.resize(fine, (60, 60), interpolation=cv2.INTER_AREA)
    assert np.abs(contrast - means).mean() < 0.5


@pytest.mark.parametrize('shape', [(1, 1), (1, 9), (7, 1)])
@pytest.mark.parametrize('level', [90, 255])
def test_the_smallest_images_and_those_all_glare_are_no_trouble(shape, level):
    contrast = tray_contrast(np.full(shape, level, np.uint8), halve=True)
    assert np.abs(contrast).max() < 1e-3
