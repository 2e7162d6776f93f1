"""The camera's lens: where points go, and back."""

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.lens import Camera

DISTORTION = (-0.03, 0.004, -0.0007, 0.0001)
LENS = Camera(
    width=1920, height=1080, focal=(1400.0, 1390.0), centre=(955.0, 545.5), distortion=DISTORTION
)
GRID = np.stack(np.meshgrid(np.linspace(0, 1920, 25), np.linspace(0, 1080, 15)), axis=-1)


def test_rectified_inverts_distorted():
    np.testing.assert_allclose(LENS.rectified(LENS.distorted(GRID)), GRID, atol=1e-9)


def test_distortion_agrees_with_opencv():
    normalised = ((GRID - LENS.centre) / LENS.focal).reshape(-1, 1, 2)
    expected = cv2.fisheye.distortPoints(normalised, LENS.matrix, np.array(DISTORTION))
    # OpenCV counts from the centre of the first pixel.
    expected_px = LENS.distorted(GRID).reshape(-1, 1, 2) - 0.5
    np.testing.assert_allclose(expected_px, expected, atol=1e-6)


def test_a_point_on_the_axis_stays_and_others_move_inwards():
    centre = np.array(LENS.centre)
    np.testing.assert_array_equal(LENS.distorted(centre), centre)
    np.testing.assert_array_equal(LENS.rectified(centre), centre)
    inside = np.linalg.norm(LENS.distorted(GRID) - centre, axis=-1)
    assert (inside < np.linalg.norm(GRID - centre, axis=-1)).all()


def test_a_pinhole_would_be_the_tangent():
    # tan t = t + t^3 / 3 + 2 t^5 / 15 + 17 t^7 / 315 + 62 t^9 / 2835 + ...
    pinhole = Camera(
        width=640,
        height=480,
        focal=(2000.0, 2000.0),
        centre=(320.0, 240.0),
        distortion=(1 / 3, 2 / 15, 17 / 315, 62 / 2835),
    )
    points = GRID / 3.0
    np.testing.assert_allclose(pinhole.distorted(points), points, atol=1e-5)


def test_no_ray_leads_beyond_a_right_angle():
    assert np.isnan(LENS.rectified(np.array([1e4, 1e4]))).all()


@pytest.mark.parametrize(
    'wrong',
    [
        {'focal': (0.0, 1400.0)},
        {'focal': (1400.0, float('nan'))},
        {'centre': (float('inf'), 540.0)},
        {'distortion': (-5.0, 0.0, 0.0, 0.0)},
        {'width': 0},
    ],
)
def test_invalid_numbers_of_a_camera_are_refused(wrong):
    good = {'width': 1920, 'height': 1080, 'focal': (1400.0, 1400.0), 'centre': (960.0, 540.0)}
    with pytest.raises(ConfigurationError, match=r'^camera: '):
        Camera(**{**good, **wrong})
