"""A container seen at an angle: its corners, scales, and the rectified picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import rectified_view
from nanorocks_ros.experiment.oblique_view import Perspective, clockwise

CORNERS = ((60.0, 20.0), (300.0, 24.0), (330.0, 220.0), (34.0, 215.0))
SEEN = Perspective(CORNERS, (280, 190))
SIZE = 360, 240


def test_corners_of_the_rectified_picture_are_those_in_the_film():
    discs = np.array([(0.0, 0.0, 1.0), (280.0, 0.0, 1.0), (280.0, 190.0, 1.0), (0.0, 190.0, 1.0)])
    assert SEEN.film_discs(discs)[:, :2] == pytest.approx(np.array(CORNERS), abs=1e-3)
    assert SEEN.film_discs(discs[:0]).shape == (0, 3)


def test_radii_in_the_film_follow_the_scale_there():
    far, near = SEEN.film_discs(np.array([(140.0, 10.0, 5.0), (140.0, 180.0, 5.0)]))[:, 2]
    assert far < near
    step = np.array(
        [(135.0, 10.0, 1.0), (145.0, 10.0, 1.0), (140.0, 5.0, 1.0), (140.0, 15.0, 1.0)]
    )
    left, right, above, below = SEEN.film_discs(step)[:, :2]
    area = abs(np.linalg.det([right - left, below - above])) / 100.0
    assert far == pytest.approx(5.0 * np.sqrt(area), rel=1e-3)


def test_the_stretch_is_that_of_the_longest_and_the_shortest_way():
    assert Perspective(((0, 0), (40, 0), (40, 20), (0, 20)), (20, 20)).stretch == pytest.approx(2)
    turned = ((30.0, 0.0), (60.0, 30.0), (30.0, 60.0), (0.0, 30.0))
    assert Perspective(turned, (42, 42)).stretch == pytest.approx(1.0)


def test_the_view_of_its_camera_is_the_same_rectified_picture():
    view = rectified_view(SEEN.camera_info(SIZE), 'test')
    places = np.random.default_rng(2).uniform(0.0, 190.0, (50, 2))
    expected = SEEN.film_discs(np.column_stack([places, np.ones(50)]))[:, :2]
    assert view.source(places) == pytest.approx(expected, abs=1e-6)


def test_what_is_painted_in_the_film_is_where_it_belongs():
    image = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
    ((column, row, _),) = SEEN.film_discs(np.array([(100.0, 60.0, 1.0)]))
    centre = round(16 * (column - 0.5)), round(16 * (row - 0.5))
    cv2.circle(image, centre, 16 * 6, (255, 255, 255), -1, cv2.LINE_AA, 4)
    shown = SEEN.rectified(image)
    assert shown.shape == (190, 280, 3)
    rows, columns = np.nonzero(shown[:, :, 0] > 127)
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((100.0, 60.0), abs=0.15)


def test_corners_are_put_in_order():
    for order in ((0, 1, 2, 3), (2, 0, 3, 1), (3, 2, 1, 0)):
        assert clockwise([CORNERS[k] for k in order]) == CORNERS


@pytest.mark.parametrize(
    'corners',
    [
        ((0, 0), (100, 0), (50, 10), (0, 100)),
        ((0, 0), (100, 0), (200, 0), (300, 0)),
        ((0, 0), (0, 0), (100, 100), (0, 100)),
    ],
)
def test_what_is_no_container_is_refused(corners):
    with pytest.raises(ConfigurationError, match='do not form a container'):
        clockwise(corners)
