"""Frames per second of the offline analyser, beside decoding the same frames alone.

1080p JPEG frames with one tray; one thread; best of three, decode and analysis in turn.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import cv2

from nanorocks_ros.experiment.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.study.bag_frames import BagFrames
from nanorocks_ros.study.film_bag import film_into_bag
from nanorocks_ros.study.offline import analyse

_SECONDS = 10.0
_ROUNDS = 3


def _decode(path: Path) -> int:
    return sum(1 for _ in BagFrames(path).frames())


def _timed(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def report() -> None:
    """Print the ratio."""
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'run'
        filmed = film_into_bag(
            path, SimulationSettings(), duration=_SECONDS, quality=90, progress=lambda *_: None
        )
        frames = filmed['frames']
        pairs = [
            (
                _timed(lambda: _decode(path)),
                _timed(lambda: analyse(path, PipelineSettings())),
            )
            for _ in range(_ROUNDS)
        ]
    decode = min(one for one, _ in pairs)
    whole = min(one for _, one in pairs)
    print(f'decode only   {frames / decode:7.1f} frames/s')
    print(f'whole analysis{frames / whole:7.1f} frames/s')
    print(f'ratio         {decode / whole:7.2f}  (1: the analysis costs nothing)')
