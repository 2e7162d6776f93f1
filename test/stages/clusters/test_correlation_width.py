"""The width of the autocorrelation of tray images, and what it says of clusters."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.autocorrelation import level_region
from nanorocks_ros.records import Autocorrelation, ClusterEstimate, SizeStatus, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.clusters.correlation_width import ClusterAutocorrelator, correlated

NS = 1_000_000_000


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
    # Averages of two by two pixels widen the smaller one a little.
    assert lengths[1] / lengths[0] == pytest.approx(2.0, rel=0.08)


def test_the_length_is_the_radius_of_the_disc_of_the_level_area():
    stage = ClusterAutocorrelator(PipelineSettings(), load_trays()[1])
    stage.emit_image = True
    estimate, picture = pushed(stage, disc_image(12))
    assert isinstance(estimate, ClusterEstimate)
    assert isinstance(picture, Autocorrelation)
    # Pictures of 13500 px/m are looked at with half of their pixels.
    assert picture.values.shape == (100, 100)
    area = level_region(picture.values, 0.5).area * (2.0 / 13500.0) ** 2
    assert estimate.level_area == pytest.approx(area)
    assert math.pi * estimate.correlation_length**2 == pytest.approx(estimate.level_area)


def test_half_the_resolution_hardly_changes_the_width():
    fine = correlated(disc_image(25), 8999.0)
    half = correlated(disc_image(25), 9000.0)
    assert (fine.side, half.side) == pytest.approx((1.0 / 8999.0, 2.0 / 9000.0))
    first, other = (seen.region(0.5).area * seen.side**2 for seen in (fine, half))
    assert other == pytest.approx(first, rel=0.03)


def rods(angle):
    picture = np.full((200, 200), 160, np.uint8)
    corner = np.array([math.cos(angle), math.sin(angle)]) * 30.0
    for middle in ((60, 60), (140, 130)):
        ends = [tuple(round(pixel) for pixel in middle + sign * corner) for sign in (-1, 1)]
        cv2.line(picture, *ends, 60, 9, cv2.LINE_AA)
    return picture


@pytest.mark.parametrize('angle', [0.0, 0.6, -1.0])
def test_rods_show_in_which_direction_they_lie(angle):
    (estimate,) = pushed(ClusterAutocorrelator(PipelineSettings(), load_trays()[1]), rods(angle))
    assert estimate.axes_ratio > 2.0
    assert estimate.direction == pytest.approx(angle, abs=0.05)


@pytest.mark.parametrize('gray', [np.full((188, 188), 120, np.uint8), np.zeros((1, 1), np.uint8)])
def test_a_flat_image_says_that_there_is_nothing(gray):
    (estimate,) = pushed(ClusterAutocorrelator(PipelineSettings(), load_trays()[1]), gray)
    assert estimate.size_status is SizeStatus.NOTHING
    assert estimate.level_area == 0.0
    assert math.isnan(estimate.cluster_size.value)
    assert math.isnan(estimate.breadth)


def test_the_noise_of_an_empty_floor_is_no_cluster():
    gray = np.random.default_rng(1).normal(140.0, 3.0, (188, 188)).astype(np.uint8)
    (estimate,) = pushed(ClusterAutocorrelator(PipelineSettings(), load_trays()[1]), gray)
    assert estimate.size_status is SizeStatus.NOTHING


@pytest.mark.parametrize('count', [1, 2, 6])
def test_of_a_few_beads_of_fifteen_the_size_is_unknown_rather_than_wrong(count):
    gray = bead_image(count)
    (estimate,) = pushed(ClusterAutocorrelator(PipelineSettings(), load_trays()[1]), gray)
    assert estimate.size_status is SizeStatus.NOTHING
    assert math.isnan(estimate.cluster_size.value)
    assert estimate.axes_ratio == pytest.approx(1.0, abs=0.05)


def bead_image(count):
    """Beads of 2 mm at 13500 px/m, far apart, on the floor of tray 1."""
    picture = np.full((202, 202), 150, np.uint8)
    for k in range(count):
        cv2.circle(picture, (30 + 45 * (k % 4), 30 + 45 * (k // 4)), 13, 50, -1, cv2.LINE_AA)
    return picture


def test_beads_pushed_together_are_a_larger_cluster_than_the_same_beads_apart():
    apart = bead_image(16)
    together = np.full_like(apart, 150)
    for k in range(16):
        cv2.circle(together, (40 + 26 * (k % 4), 40 + 26 * (k // 4)), 13, 50, -1, cv2.LINE_AA)
    sizes = []
    for gray in (apart, together):
        (estimate,) = pushed(ClusterAutocorrelator(PipelineSettings(), load_trays()[1]), gray)
        sizes.append(
            estimate.cluster_size.value
            if math.isfinite(estimate.cluster_size.value)
            else estimate.cluster_size.lower
        )
    assert sizes[0] < 1.5
    assert sizes[1] > 3.0


def strange_tray():
    tray = load_trays()[1]
    return replace(tray, species=(replace(tray.species[0], count=7),))


def test_a_tray_without_calibration_says_once_which_command_makes_it():
    stage = ClusterAutocorrelator(PipelineSettings(), strange_tray())
    estimate, notice = pushed(stage, bead_image(7))
    assert estimate.size_status is SizeStatus.UNCALIBRATED
    assert math.isnan(estimate.cluster_size.value)
    assert estimate.level_area > 0.0
    assert 'nanorocks cluster-curve --trays 1 -o curve.npz' in notice.text
    (again,) = pushed(stage, bead_image(7), NS)
    assert again.size_status is SizeStatus.UNCALIBRATED


def test_another_level_has_no_calibration_and_says_so():
    settings = with_values(PipelineSettings(), {'clusters.level': 0.4}, 'test')
    estimate, notice = pushed(ClusterAutocorrelator(settings, load_trays()[1]), bead_image(9))
    assert estimate.size_status is SizeStatus.UNCALIBRATED
    assert 'calibrated for clusters.level 0.5' in notice.text


def test_a_calibration_that_was_named_and_is_not_there_is_refused(tmp_path):
    path = tmp_path / 'none.npz'
    settings = with_values(PipelineSettings(), {'clusters.curve': str(path)}, 'test')
    with pytest.raises(ConfigurationError, match='make it again with `nanorocks cluster-curve`'):
        ClusterAutocorrelator(settings, load_trays()[1])


def test_estimates_keep_their_interval():
    stage = ClusterAutocorrelator(PipelineSettings(), load_trays()[1])
    picture = disc_image(10)
    times = [k for k in range(60) if pushed(stage, picture, k * NS // 30)]
    assert times == list(range(0, 60, 6))
