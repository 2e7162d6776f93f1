"""Speeds in films whose camera moves, against the true speeds."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.records import Frame, Notice, SpeedEstimate
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_film import film

NS = 1_000_000_000
RATE = 30.0
FRAMES = 135
# Half a second after the shaking event of the foreign film, a second after that of ours.
FIRST = 60
JITTER_FILM = Path(__file__).resolve().parents[3] / 'shared/data/foreign/b1_jitter.mp4'


def shifted(image, shift):
    """The picture moved by a shift [px], encoded and decoded again."""
    matrix = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
    size = image.shape[1::-1]
    warped = cv2.warpAffine(
        image, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
    )
    _, packed = cv2.imencode('.jpg', warped, [cv2.IMWRITE_JPEG_QUALITY, 95])
    return cv2.imdecode(packed, cv2.IMREAD_COLOR)


def measured(pictures, true_speeds):
    """What is said, and ratio to the truth and motion of the tray of each speed.

    From half a second after the shaking on, so that no window begins before it.
    """
    pipeline = Pipeline(PipelineSettings(trays=(1,)), 'film')
    records = []
    for k, image in enumerate(pictures):
        stamp_ns = NS + round(k * NS / RATE)
        records += pipeline.push(Frame(stamp_ns=stamp_ns, encoding='bgr8', image=image))
    records += pipeline.flush()
    rows = []
    for speed in records:
        if not isinstance(speed, SpeedEstimate):
            continue
        frame, half = (speed.stamp_ns / NS - 1.0) * RATE, 0.5 * speed.window * RATE
        if frame < FIRST:
            continue
        true = true_speeds[round(frame - half) : round(frame + half) + 1].mean()
        rows.append((speed.mean_projected_speed.value / true, speed.tray_speed))
    notices = [record.text for record in records if isinstance(record, Notice)]
    return notices, np.array(rows)


@pytest.fixture(scope='module')
def still_film():
    """Pictures of tray 1 with a camera at rest, and the mean projected speeds."""
    values = {'width_px': 250, 'height_px': 250, 'first_shake': 1.0, 'mean_speed': 0.004}
    settings = with_values(SimulationSettings(), values, 'test')
    pictures, speeds = [], []
    for frame, truth in film(settings, load_trays()[1], FRAMES):
        pictures.append(np.array(frame.image))
        speeds.append(truth.mean_projected_speed)
    return pictures, np.array(speeds)


CAMERAS = {
    'jitter': np.random.default_rng(3).normal(0.0, 2.0, (FRAMES, 2)),
    'sway': 2.0 * np.sin(2.0 * np.pi * 0.7 * np.arange(FRAMES) / RATE)[:, None] * [0.8, 0.6],
}


@pytest.mark.parametrize('camera', list(CAMERAS))
def test_a_camera_that_moves_changes_no_speed_by_5_percent(still_film, camera):
    pictures, speeds = still_film
    moved = [shifted(image, d) for image, d in zip(pictures, CAMERAS[camera], strict=True)]
    notices, rows = measured(moved, speeds)
    assert len(rows) > 15
    assert rows[:, 0].mean() == pytest.approx(1.0, abs=0.05)
    assert rows[:, 1].max() < 1e-5
    assert sum('tray 1: the camera moves' in text for text in notices) == 1


def test_nothing_is_said_of_a_camera_at_rest(still_film):
    notices, rows = measured(*still_film)
    assert rows[:, 0].mean() == pytest.approx(1.0, abs=0.03)
    assert not any('camera moves' in text for text in notices)


def test_a_foreign_film_with_jitter_gives_the_true_speeds():
    truth_file = JITTER_FILM.with_suffix('.npz')
    if not truth_file.is_file():
        pytest.skip(f'{JITTER_FILM} is not there: foreign films are not part of the package')
    video, pictures = cv2.VideoCapture(str(JITTER_FILM)), []
    while len(pictures) < FRAMES:
        decoded, image = video.read()
        assert decoded
        pictures.append(image)
    with np.load(truth_file) as truth:
        speeds = np.linalg.norm(truth['V'][..., :2], axis=-1).mean(axis=1)
    notices, rows = measured(pictures, speeds)
    assert len(rows) > 15
    assert rows[:, 0].mean() == pytest.approx(1.0, abs=0.05)
    assert any('tray 1: the camera moves' in text for text in notices)
