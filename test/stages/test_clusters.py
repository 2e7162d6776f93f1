"""The autocorrelation against its definition, and what its width says."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from nanorocks_ros.experiment.settings import PipelineSettings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Autocorrelation, ClusterEstimate, TrayImage
from nanorocks_ros.stages.clusters import ClusterAutocorrelator, autocorrelation

NS = 1_000_000_000


def naive_autocorrelation(gray):
    rows, columns = gray.shape
    deviation = gray.astype(float) - gray.mean()
    found = np.zeros((rows, columns))
    for i in range(rows):
        for j in range(columns):
            dy, dx = i - rows // 2, j - columns // 2
            a = deviation[max(0, dy) : rows + min(0, dy), max(0, dx) : columns + min(0, dx)]
            b = deviation[max(0, -dy) : rows + min(0, -dy), max(0, -dx) : columns + min(0, -dx)]
            found[i, j] = (a * b).sum()
    return found / (deviation**2).sum()


@pytest.mark.parametrize('shape', [(16, 16), (17, 12), (9, 21)])
def test_the_fast_autocorrelation_is_the_one_by_definition(shape):
    gray = np.random.default_rng(2).integers(0, 256, shape, dtype=np.uint8)
    assert autocorrelation(gray) == pytest.approx(naive_autocorrelation(gray), abs=1e-5)


def test_zero_lag_lies_in_the_centre_and_is_one():
    gray = np.random.default_rng(2).integers(0, 256, (30, 41), dtype=np.uint8)
    values = autocorrelation(gray)
    assert values[15, 20] == pytest.approx(1.0)
    assert values.max() == values[15, 20]


def test_a_uniform_image_has_no_correlation_rather_than_a_division_by_zero():
    assert not autocorrelation(np.full((20, 20), 90, np.uint8)).any()


def disc_image(radius):
    picture = np.full((200, 200), 160, np.uint8)
    cv2.circle(picture, (100, 100), radius, 60, -1, cv2.LINE_AA)
    return picture


def pushed(stage, gray, stamp_ns=0):
    return stage.push(TrayImage(stamp_ns=stamp_ns, tray=1, gray=gray))


def test_the_correlation_length_grows_in_proportion_to_what_is_seen():
    tray = load_trays()[1]
    lengths = []
    for radius in (8, 16):
        (estimate,) = pushed(ClusterAutocorrelator(PipelineSettings(), tray), disc_image(radius))
        lengths.append(estimate.correlation_length)
    assert lengths[1] / lengths[0] == pytest.approx(2.0, rel=0.05)


def test_the_length_is_the_radius_of_the_disc_of_the_level_area():
    stage = ClusterAutocorrelator(PipelineSettings(), load_trays()[1])
    stage.emit_image = True
    estimate, picture = pushed(stage, disc_image(12))
    assert isinstance(estimate, ClusterEstimate)
    assert isinstance(picture, Autocorrelation)
    pixels = (picture.values > 0.5).sum()
    assert estimate.level_area == pytest.approx(pixels / 13500**2)
    assert math.pi * estimate.correlation_length**2 == pytest.approx(estimate.level_area)


def test_estimates_keep_their_interval():
    stage = ClusterAutocorrelator(PipelineSettings(), load_trays()[1])
    picture = disc_image(10)
    times = [k for k in range(60) if pushed(stage, picture, k * NS // 30)]
    assert times == list(range(0, 60, 6))
