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


def test_of_a_mask_what_moves_is_seen_and_the_rest_is_seen_through():
    mask = np.zeros((1, 5000), np.uint8)
    mask[0, 100] = 1
    picture = decoded(encoded('motion', mask))
    assert picture.shape == (1, 5000, 4)
    assert np.flatnonzero(picture[0, :, 3]).tolist() == [100]
