"""The autocorrelation against its definition and against shapes whose own is known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import fftconvolve

from nanorocks_ros.physics.autocorrelation import autocorrelation, level_region

SIDE = 400
Y, X = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2.0


def naive_autocorrelation(image):
    rows, columns = image.shape
    deviation = image.astype(float) - image.mean()
    covariance = np.zeros((rows, columns))
    for i in range(rows):
        for j in range(columns):
            dy, dx = i - rows // 2, j - columns // 2
            a = deviation[max(0, dy) : rows + min(0, dy), max(0, dx) : columns + min(0, dx)]
            b = deviation[max(0, -dy) : rows + min(0, -dy), max(0, -dx) : columns + min(0, -dx)]
            covariance[i, j] = (a * b).sum()
    return covariance / (deviation**2).sum()


@pytest.mark.parametrize('shape', [(16, 16), (17, 12), (9, 21), (2, 2), (1, 7), (8, 1)])
def test_the_fast_autocorrelation_equals_its_definition(shape):
    image = np.random.default_rng(2).integers(0, 256, shape, dtype=np.uint8)
    assert autocorrelation(image) == pytest.approx(naive_autocorrelation(image), abs=1e-5)


def test_it_is_the_convolution_of_scipy_with_the_reversed_image():
    image = np.random.default_rng(3).integers(0, 256, (94, 200), dtype=np.uint8)
    deviation = image - image.mean()
    whole = fftconvolve(deviation, deviation[::-1, ::-1])
    inner = whole[93 - 47 : 93 + 47, 199 - 100 : 199 + 100]
    assert autocorrelation(image) == pytest.approx(inner / whole[93, 199], abs=1e-5)


def test_zero_lag_lies_in_the_centre_and_is_one():
    image = np.random.default_rng(2).integers(0, 256, (30, 41), dtype=np.uint8)
    values = autocorrelation(image)
    assert values[15, 20] == pytest.approx(1.0)
    assert values.max() == values[15, 20]


@pytest.mark.parametrize('shape', [(20, 20), (1, 1), (3, 50)])
def test_a_uniform_image_has_no_correlation_rather_than_a_division_by_zero(shape):
    values = autocorrelation(np.full(shape, 90, np.uint8))
    assert not values.any()
    region = level_region(values, 0.5)
    assert region.area == 0.0
    assert math.isnan(region.axes_ratio)
    assert math.isnan(region.direction)


def disc_overlap(lag, radius):
    u = min(lag / (2.0 * radius), 1.0)
    return 2.0 / math.pi * (math.acos(u) - u * math.sqrt(1.0 - u * u))


@pytest.mark.parametrize('radius', [6.3, 12.5, 30.0])
def test_the_level_area_of_a_disc_is_that_of_the_lens_formula(radius):
    disc = (np.hypot(X, Y) < radius).astype(np.float32)
    area = level_region(autocorrelation(disc), 0.5).area
    # As it lies on the pixels.
    radius = math.sqrt(disc.sum() / math.pi)
    # The mean is taken off: with a share p of the picture, C = (overlap - p) / (1 - p).
    share = disc.mean()
    level = 0.5 * (1.0 - share) + share
    expected = brentq(lambda lag: disc_overlap(lag, radius) - level, 0.0, 2.0 * radius)
    assert math.sqrt(area / math.pi) == pytest.approx(expected, rel=0.015)


@pytest.mark.parametrize('level', [0.5, 0.7])
def test_the_level_area_of_a_square_is_that_of_the_product_of_two_triangles(level):
    side = 40
    square = np.zeros((SIDE, SIDE), np.float32)
    square[100 : 100 + side, 150 : 150 + side] = 1.0
    share = square.mean()
    threshold = level * (1.0 - share) + share
    # (1 - x/s)(1 - y/s) > l: the area is 4 s^2 (1 - l + l ln l).
    expected = 4.0 * side**2 * (1.0 - threshold + threshold * math.log(threshold))
    region = level_region(autocorrelation(square), level)
    assert region.area == pytest.approx(expected, rel=0.01)
    assert region.axes_ratio == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize('direction', [0.0, 0.3, 1.1, -0.5, -1.2])
def test_a_turned_gaussian_shows_its_axes_and_their_direction(direction):
    along = X * math.cos(direction) + Y * math.sin(direction)
    across = Y * math.cos(direction) - X * math.sin(direction)
    blob = np.exp(-0.5 * (along**2 / 12.0**2 + across**2 / 5.0**2)).astype(np.float32)
    region = level_region(autocorrelation(blob), 0.5)
    assert region.area == pytest.approx(4.0 * math.pi * 12.0 * 5.0 * math.log(2.0), rel=0.01)
    assert region.axes_ratio == pytest.approx(2.4, rel=0.01)
    assert region.direction == pytest.approx(direction, abs=0.002)
    assert region.whole


def test_the_level_area_has_no_steps_of_a_pixel():
    radii = np.arange(10.0, 11.0, 0.05)
    areas = np.array(
        [
            level_region(autocorrelation(np.exp(-0.5 * (X**2 + Y**2) / r**2)), 0.5).area
            for r in radii
        ]
    )
    smooth = np.polyval(np.polyfit(radii - 10.5, areas, 2), radii - 10.5)
    # A pixel is 0.1 % of them.
    assert areas == pytest.approx(smooth, rel=1e-4)


def test_other_peaks_above_the_level_do_not_count():
    pair = np.zeros((SIDE, SIDE), np.float32)
    single = pair.copy()
    single[190:210, 100:120] = 1.0
    pair[190:210, 100:120] = 1.0
    pair[190:210, 200:220] = 1.0
    # At the distance of the two the correlation is a half: above the level of 0.4.
    values = autocorrelation(pair)
    assert values[SIDE // 2, SIDE // 2 + 100] > 0.45
    region = level_region(autocorrelation(single), 0.4)
    assert level_region(values, 0.4).area == pytest.approx(region.area, rel=0.03)


def test_a_region_that_reaches_the_last_lag_is_not_whole():
    ramp = np.tile(np.arange(40.0, dtype=np.float32), (40, 1))
    assert not level_region(autocorrelation(ramp), 0.1).whole
