"""Crops by interpolation against the same worked out slowly, pixel by pixel."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.stages.preprocess.crop_interpolation import fill_by_pixels, moved
from nanorocks_ros.stages.preprocess.rectify import (
    mix_weights,
    nodes_of,
    resample_color,
    resample_gray,
)

LENS = View(
    camera=Camera(
        width=320,
        height=240,
        focal=(280.0, 280.0),
        centre=(165.0, 117.0),
        distortion=(-0.02, 0.004, 0.0, 0.0),
    )
)
NO_LENS = View(camera=IdentityLens(width=320, height=240))
# Neither side is a multiple of the distance between two nodes.
REGION = Region(31, 22, 133, 78)
MIX = (0.45, 0.45, 0.1)


def picture(channels=3):
    rng = np.random.default_rng(4)
    noise = rng.integers(0, 256, (240, 320, channels), dtype=np.uint8)
    return cv2.GaussianBlur(noise, (0, 0), 1.0).reshape(240, 320, channels)


def slowly(image, region, view, shift):
    x = region.x + 0.5 + np.arange(region.width) + shift[0]
    y = region.y + 0.5 + np.arange(region.height) + shift[1]
    at = view.source(np.stack(np.meshgrid(x, y), axis=-1)) - 0.5
    a, b = np.floor(at[..., 0]).astype(int), np.floor(at[..., 1]).astype(int)
    right, below = (at[..., 0] - a)[..., None], (at[..., 1] - b)[..., None]
    level = image.astype(float)
    above = level[b, a] * (1 - right) + level[b, a + 1] * right
    under = level[b + 1, a] * (1 - right) + level[b + 1, a + 1] * right
    return above * (1 - below) + under * below


def quickly(image, region, view, shift):
    color = np.empty((region.height, region.width, 3), np.uint8)
    gray = np.empty((region.height, region.width), np.uint8)
    resample_color(image, nodes_of(region, view), shift, mix_weights(MIX), color, gray)
    return color, gray


@pytest.mark.parametrize('view', [LENS, NO_LENS], ids=['lens', 'straight'])
@pytest.mark.parametrize('shift', [(0.0, 0.0), (0.5, -0.25), (-3.3, 2.8)])
def test_a_crop_is_the_bilinear_interpolation_of_the_frame(view, shift):
    image = picture()
    color, gray = quickly(image, REGION, view, shift)
    expected = slowly(image, REGION, view, shift)
    assert np.abs(color - expected).max() < 1.5
    assert np.abs(color - expected).mean() < 0.35
    assert np.abs(gray - color.astype(float) @ np.array(MIX)).max() < 0.51


def test_a_whole_shift_without_a_lens_is_a_crop_to_the_last_bit():
    image = picture()
    color, _ = quickly(image, REGION, NO_LENS, (2.0, -5.0))
    x, y, width, height = REGION
    assert np.array_equal(color, image[y - 5 : y - 5 + height, x + 2 : x + 2 + width])


def test_a_gray_picture_gives_what_its_copies_as_colours_give():
    image = picture(1)
    shift = (0.3, 0.6)
    gray = np.empty((REGION.height, REGION.width), np.uint8)
    resample_gray(image[:, :, 0], nodes_of(REGION, LENS), shift, gray)
    color, _ = quickly(np.repeat(image, 3, axis=2), REGION, LENS, shift)
    assert np.array_equal(gray, color[:, :, 1])


def test_beyond_the_edge_of_the_frame_its_edge_is_seen():
    image = np.full((240, 320, 3), 90, np.uint8)
    image[:, 0] = 200
    color, _ = quickly(image, Region(0, 100, 40, 20), NO_LENS, (-30.0, 0.0))
    assert np.abs(color[:, :30].astype(int) - 200).max() <= 1
    assert (color[:, 31:] == 90).all()


@pytest.mark.parametrize('mix', [(0.45, 0.45, 0.1), (1 / 3, 1 / 3, 1 / 3), (0.2, 0.5, 0.3)])
def test_the_whole_weights_of_the_gray_mix_keep_their_sum(mix):
    weights = mix_weights(mix)
    assert weights.sum() == round(65536 * sum(mix))
    assert np.abs(weights - 65536 * np.array(mix)).max() < 1.0


@pytest.mark.parametrize('scale', [0.3, 0.87, 0.93, 1.0, 1.07, 1.6])
@pytest.mark.parametrize('tilt', [-0.2, -0.01, 0.0, 0.05])
@pytest.mark.parametrize('size', [(78, 133), (21, 16), (30, 15), (1, 40)])
def test_eight_pixels_at_once_are_those_one_by_one_to_the_last_bit(scale, tilt, size):
    image = picture()
    nodes = np.zeros((size[0] // 8 + 2, size[1] // 8 + 2, 6))
    y, x = 8.0 * np.indices(nodes.shape[:2])
    nodes[..., 0], nodes[..., 1] = 40.3 + scale * x - tilt * y, 45.7 + scale * y + tilt * x
    color, gray = np.empty((*size, 3), np.uint8), np.empty(size, np.uint8)
    resample_color(image, nodes, (0.0, 0.0), mix_weights(MIX), color, gray)
    places = (moved(nodes, (0.0, 0.0), axis, pixels) for axis, pixels in ((0, 320), (1, 240)))
    expected = np.empty_like(color)
    fill_by_pixels(image, *places, 0, expected)
    assert (color == expected).all()
