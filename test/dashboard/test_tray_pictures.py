"""Pictures of any shape as a browser takes them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.dashboard.tray_pictures import encoded


def decoded(content):
    return cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize(
    ('shape', 'shown'),
    [
        ((120, 160, 3), (120, 160, 3)),
        ((1800, 900, 3), (900, 450, 3)),
        ((1, 5000, 3), (1, 900, 3)),
        ((5000, 1), (900, 1)),
        ((1, 1), (1, 1)),
    ],
)
def test_large_pictures_are_made_smaller_and_of_strips_something_is_left(shape, shown):
    picture = decoded(encoded('tracks', np.full(shape, 90, np.uint8)))
    assert picture.shape == shown
    assert abs(int(picture.mean()) - 90) < 3


def test_of_a_mask_the_outlines_of_what_moves_are_seen_and_nothing_is_filled():
    mask = np.zeros((120, 160), np.uint8)
    cv2.circle(mask, (80, 60), 20, (1,), -1)
    mask[10, 10] = 1
    opacity = decoded(encoded('motion', mask))[..., 3]
    scale = opacity.shape[0] / 120
    rows, columns = np.nonzero(opacity > 127)
    radii = np.hypot(rows / scale - 60, columns / scale - 80)
    assert radii.size > 100
    assert np.all(np.abs(radii - 20) < 2)


@pytest.mark.parametrize('shape', [(1, 5000), (1, 1), (900, 900)])
def test_a_mask_of_any_shape_is_seen_through_where_nothing_moves(shape):
    picture = decoded(encoded('motion', np.zeros(shape, np.uint8)))
    assert picture.shape[2] == 4
    assert picture.shape[0] * shape[1] == picture.shape[1] * shape[0]
    assert not picture[..., 3].any()
