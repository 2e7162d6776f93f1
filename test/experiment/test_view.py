"""The rectified view against OpenCV, and what cannot be one."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import CameraInfo, rectified_view
from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.experiment.view import View

K = (700.0, 0.0, 955.0, 0.0, 700.0, 541.0, 0.0, 0.0, 1.0)
TURN = tuple(cv2.Rodrigues(np.array([0.02, -0.03, 0.01]))[0].ravel())
P = (690.0, 0.0, 970.0, 0.0, 0.0, 690.0, 530.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def info(**values):
    numbers = {'distortion_model': 'equidistant', 'd': (-0.02, 0.004, 0.001, 0.0), 'k': K}
    return CameraInfo(**{'width': 1920, 'height': 1080, **numbers, **values})


def by_opencv(camera_info):
    """Where each pixel comes from, counted from the centre of the first pixel."""
    k, r, p = (
        np.array(m).reshape(-1, n)
        for m, n in ((camera_info.k, 3), (camera_info.r, 3), (camera_info.p, 4))
    )
    size = (camera_info.width, camera_info.height)
    if camera_info.distortion_model == 'equidistant':
        return cv2.fisheye.initUndistortRectifyMap(
            k, np.array(camera_info.d), r, p[:, :3], size, cv2.CV_32FC1
        )
    return cv2.initUndistortRectifyMap(k, np.array(camera_info.d), r, p[:, :3], size, cv2.CV_32FC1)


@pytest.mark.parametrize(
    ('model', 'd'),
    [
        ('equidistant', (-0.02, 0.004, 0.001, 0.0)),
        ('plumb_bob', (-0.11, 0.02, 0.001, -0.002, 0.003)),
    ],
)
def test_the_map_agrees_with_opencv(model, d):
    camera_info = info(distortion_model=model, d=d, r=TURN, p=P)
    x, y = np.meshgrid(np.arange(0, 1920, 97), np.arange(0, 1080, 83))
    source_px = rectified_view(camera_info, 'test').source(np.stack([x, y], axis=-1) + 0.5) - 0.5
    map_x, map_y = by_opencv(camera_info)
    assert source_px[..., 0] == pytest.approx(map_x[y, x], abs=2e-3)
    assert source_px[..., 1] == pytest.approx(map_y[y, x], abs=2e-3)


def test_without_r_and_p_the_view_is_that_of_the_camera_itself():
    zeros = info(r=(0.0,) * 9, p=(0.0,) * 12)
    camera = Camera(
        width=1920,
        height=1080,
        focal=(700.0, 700.0),
        centre=(955.5, 541.5),
        distortion=(-0.02, 0.004, 0.001, 0.0),
    )
    assert rectified_view(zeros, 'test') == rectified_view(info(), 'test') == View(camera=camera)


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        (
            {'distortion_model': 'rational_polynomial'},
            r"'rational_polynomial' is not supported; calibrate for equidistant or plumb_bob",
        ),
        ({'k': (0.0,) * 9}, 'k is all zero: the camera is not calibrated'),
        ({'k': (1.0, 2.0)}, '2, 9, 0 numbers in k, r, p'),
        ({'r': (2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)}, 'r is no rotation'),
        ({'p': (-1.0, *P[1:])}, 'p has no focal lengths'),
        ({'d': (float('nan'),)}, 'numbers'),
        ({'d': (-5.0, 0.0, 0.0, 0.0)}, 'folds the picture over'),
    ],
)
def test_an_invalid_camera_info_is_refused(values, message):
    with pytest.raises(ConfigurationError, match=f'^/camera_info: .*{message}'):
        rectified_view(info(**values), '/camera_info')
