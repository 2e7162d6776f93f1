"""Speeds over the truth in films whose camera moves: foreign films, shifted and encoded again.

The films lie beside the checkout, in ``../shared/data/foreign``.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.records import Frame, Quality, SpeedEstimate
from nanorocks_ros.settings import PipelineSettings

_FOREIGN = Path(__file__).resolve().parents[2] / 'shared' / 'data' / 'foreign'
_NS = 1_000_000_000
_SECONDS = 25.0
# From half a second after the kick on, [s].
_FIRST = 2.2
_DECADES = ((1e-4, 3e-4), (3e-4, 1e-3), (1e-3, 3e-3), (3e-3, 1e-2))
_DIRECTION = np.array([0.8, 0.6])
_QUALITY = 95
# A film, what is done to its pictures.
_RUNS = (
    *(('b1_mu', motion) for motion in ('none', 'jitter', 'sway', 'drift', 'knock')),
    ('b1_jitter', 'none'),
    *(('p3a', motion) for motion in ('none', 'jitter', 'sway')),
)


def _shifts(motion: str, times: np.ndarray) -> np.ndarray:
    """Motion of the picture, (frames, 2), [px]."""
    if motion == 'jitter':
        return np.random.default_rng(0).normal(0.0, 2.0, (times.size, 2))
    if motion == 'sway':
        return 2.0 * np.sin(2.0 * np.pi * 0.7 * times)[:, None] * _DIRECTION
    if motion == 'drift':
        return 0.5 * times[:, None] * _DIRECTION
    return np.where(times[:, None] > 8.0, [3.3, -2.1], 0.0)


def _shifted(image: np.ndarray, shift: np.ndarray) -> np.ndarray:
    matrix = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
    size = image.shape[1::-1]
    moved = cv2.warpAffine(
        image, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
    )
    _, packed = cv2.imencode('.jpg', moved, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return cv2.imdecode(packed, cv2.IMREAD_COLOR)


def _frames(name: str, motion: str, rate: float):
    video = cv2.VideoCapture(str(_FOREIGN / f'{name}.mp4'))
    times = np.arange(round(_SECONDS * rate)) / rate
    shifts = None if motion == 'none' else _shifts(motion, times)
    for k, time in enumerate(times):
        decoded, image = video.read()
        if not decoded:
            return
        if shifts is not None:
            image = _shifted(image, shifts[k])
        yield Frame(stamp_ns=_NS + round(time * _NS), encoding='bgr8', image=image)


def _speeds(name: str, motion: str) -> np.ndarray:
    """True speed [m/s], measured speed [m/s] and whether it is flagged, of each estimate."""
    with np.load(_FOREIGN / f'{name}.npz') as truth:
        rate, tray = float(truth['fps']), int(truth['tray'])
        true = np.linalg.norm(truth['V'][..., :2], axis=-1).mean(axis=1)
    pipeline = Pipeline(PipelineSettings(trays=(tray,)), name)
    records = [record for frame in _frames(name, motion, rate) for record in pipeline.push(frame)]
    rows = []
    for speed in (*records, *pipeline.flush()):
        if not isinstance(speed, SpeedEstimate) or speed.stamp_ns < _NS * (1.0 + _FIRST):
            continue
        frame, half = (speed.stamp_ns / _NS - 1.0) * rate, 0.5 * speed.window * rate
        mean = true[round(frame - half) : round(frame + half) + 1].mean()
        flagged = Quality.STABILISATION_LOST in speed.quality
        rows.append((mean, speed.mean_projected_speed.value, flagged))
    return np.array(rows)


def report() -> None:
    """Print mean measured over mean true speed of each film, by speed."""
    spans = ' | '.join(f'{low * 1e3:g} to {high * 1e3:g} mm/s' for low, high in _DECADES)
    print(f'| film | motion of the camera | {spans} | flagged |')
    print('| --- ' * (len(_DECADES) + 3) + '|')
    for name, motion in _RUNS:
        true, measured, flagged = _speeds(name, motion).T
        cells = []
        for low, high in _DECADES:
            rows = (true >= low) & (true < high)
            ratio = f'{measured[rows].mean() / true[rows].mean():.3f}' if rows.any() else ''
            cells.append(ratio)
        print(f'| {name} | {motion} | {" | ".join(cells)} | {flagged.mean():.2f} |', flush=True)
