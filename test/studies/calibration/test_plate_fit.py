"""Lens and pose from the edges of a drawn plate: every kind of lens, straight and tilted."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from plates import Plate

from nanorocks_ros.experiment.calibration import CameraInfo, rectified_view
from nanorocks_ros.stages.preprocess.plate_search import guess_plate
from nanorocks_ros.studies.calibration.plate_fit import fit_plate

WIDTH, HEIGHT, SCALE = 960, 630, 7200.0


class Tilted:
    """A camera before a plate that it does not look straight at."""

    def __init__(self, focal, distortion, turn):
        rotation = cv2.Rodrigues(np.array(turn, dtype=float))[0]
        x, y = 0.5 * WIDTH + 6.0, 0.5 * HEIGHT - 4.0
        # Where the middle of the picture is seen, so that the plate lies around it.
        across, down, away = rotation.T @ (-6.0 / focal, 4.0 / focal, 1.0)
        middle = 0.5 * WIDTH - focal * across / away, 0.5 * HEIGHT - focal * down / away
        self.info = CameraInfo(
            width=WIDTH,
            height=HEIGHT,
            distortion_model='equidistant',
            d=(*distortion, 0.0, 0.0),
            k=(focal, 0.0, x - 0.5, 0.0, focal, y - 0.5, 0.0, 0.0, 1.0),
            r=tuple(rotation.T.ravel()),
            p=(focal, 0, middle[0] - 0.5, 0, 0, focal, middle[1] - 0.5, 0, 0, 0, 1, 0),
        )
        self.view = rectified_view(self.info, 'test')

    def rectified(self, points):
        """Where points of the picture are on the plate as seen from straight above."""
        straight = self.view.camera.rectified(points)
        matrix = np.linalg.inv(np.array(self.view.homography).reshape(3, 3))
        spread = straight @ matrix[:, :2].T + matrix[:, 2]
        return spread[..., :2] / spread[..., 2:]


def fitted(camera):
    plate = Plate(camera, shape=(HEIGHT, WIDTH), scale=SCALE)
    gray = cv2.cvtColor(plate.picture(noise=1.0), cv2.COLOR_BGR2GRAY)
    trays = list(plate.trays.values())
    return plate, fit_plate(gray.astype(np.float32), trays, guess_plate(gray, trays))


def left_over(fit, camera):
    """How far points of the trays are off, but for what moving and scaling all makes good."""
    shares = np.linspace(0.0, 1.0, 5)
    points = np.concatenate(
        [
            np.stack(np.meshgrid(x + w * shares, y + h * shares), axis=-1).reshape(-1, 2)
            for x, y, w, h in fit.calibration.regions.values()
        ]
    )
    true = camera.rectified(fit.calibration.view.source(points))
    mine, aim = points @ (1.0, 1j), true @ (1.0, 1j)
    rows = np.stack([mine, np.ones_like(mine)], axis=-1)
    return np.abs(rows @ np.linalg.lstsq(rows, aim, rcond=None)[0] - aim).max()


@pytest.mark.parametrize(
    ('focal', 'distortion', 'turn'),
    [
        (1e6, (0.0, 0.0), (0.0, 0.0, 0.0)),
        (750.0, (-0.02, 0.004), (0.0, 0.0, 0.0)),
        (750.0, (-0.02, 0.004), (0.05, 0.05, 0.035)),
        (750.0, (0.45, 0.0), (0.0, 0.0, 0.0)),
    ],
    ids=['no lens', 'fisheye', 'fisheye, tilted by 4 degrees', 'pincushion'],
)
def test_the_trays_are_put_right_whatever_lens_and_pose(focal, distortion, turn):
    camera = Tilted(focal, distortion, turn)
    plate, fit = fitted(camera)
    assert fit.calibration.residual_px < 0.1
    assert left_over(fit, camera) < 0.5
    assert len(fit.residuals) > 0.9 * fit.edges.expected
    for number, region in plate.regions.items():
        assert np.abs(np.array(fit.calibration.regions[number]) - region).max() <= 1


def test_the_scale_of_a_tray_in_the_frame_is_told_for_each():
    camera = Tilted(750.0, (0.0, 0.0), (0.0, 0.12, 0.0))
    _, fit = fitted(camera)
    scales = fit.tray_scales
    # Turned about the vertical, one side of the plate is nearer.
    assert math.log(scales[2] / scales[3]) == pytest.approx(
        math.log(scales[4] / scales[5]), abs=2e-3
    )
    assert abs(scales[2] / scales[3] - 1.0) > 0.03


def test_a_picture_without_trays_is_not_fitted():
    plate = Plate(shape=(HEIGHT, WIDTH), scale=SCALE)
    rng = np.random.default_rng(1)
    gray = rng.integers(100, 140, (HEIGHT, WIDTH), dtype=np.uint8)
    trays = list(plate.trays.values())
    guess = guess_plate(gray, trays)
    assert guess.contrast < 1.5
    assert fit_plate(gray.astype(np.float32), trays, guess) is None
