"""Frames per second of the offline analysis on one core, against decoding the same frames.

1080p JPEG frames of one tray, and of the whole plate with eight trays and all options; in CPU time
of one thread, which depends little on other work of the machine. Decoding and analysis alternate;
for one tray the best of three. The ratio is to decoding by OpenCV; the analysis decodes by
`simplejpeg` where it is installed. OFFLINE_PLATE_BAG names an existing film of the plate:
`nanorocks simulate --scene --bag BAG --duration 60 --first-shake 0.5`.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2

from benchmarks.live_plate import PLATE, filmed_plate
from nanorocks_ros.pipeline.warm_up import (
    warm_up,
    warm_up_clusters,
    warm_up_cooling,
    warm_up_speed,
)
from nanorocks_ros.recordings import image_decoding
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag

_SECONDS = 10.0
_PLATE_SECONDS = 60.0
_ROUNDS = 3


def _decode(path: Path) -> int:
    return sum(1 for _ in BagFrames(path).frames())


def _decode_by_opencv(path: Path) -> int:
    library, image_decoding.simplejpeg = image_decoding.simplejpeg, None
    try:
        return _decode(path)
    finally:
        image_decoding.simplejpeg = library


def _timed(work) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def warm() -> None:
    """Compile or load what the analysis calls, and decode on one core."""
    cv2.setNumThreads(1)
    for function in (warm_up, warm_up_speed, warm_up_clusters, warm_up_cooling):
        function()


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure_plate(path: str) -> None:
    """Print CPU times and memory of decoding and analysing a film of the plate, as JSON."""
    warm()
    peaks: dict[int, float] = {}

    def note(done: int, frames: int) -> None:
        peaks[round(3 * done / frames, 9)] = _peak_mb()

    opencv = _timed(lambda: _decode_by_opencv(Path(path)))
    decode = _timed(lambda: _decode(Path(path)))
    settings = with_values(PipelineSettings(), PLATE, 'benchmark')
    before = _peak_mb()
    folder = Path(path).parent
    analysis = _timed(lambda: analyse(path, settings, progress=note, scratch=folder))
    third = min(at for at in peaks if at >= 1.0)
    frames = BagFrames(path).count
    print(json.dumps([frames, (opencv, decode, analysis), before, peaks[third], _peak_mb()]))


def report() -> None:
    """Print the ratios."""
    with tempfile.TemporaryDirectory() as folder:
        _print_tray(Path(folder) / 'run')
        bag = filmed_plate(folder, _PLATE_SECONDS, os.environ.get('OFFLINE_PLATE_BAG', ''))
        _print_plate(bag)


def _print_tray(path: Path) -> None:
    warm()
    filmed = film_into_bag(
        path, SimulationSettings(), duration=_SECONDS, quality=90, progress=lambda *_: None
    )
    rounds = [
        (
            _timed(lambda: _decode_by_opencv(path)),
            _timed(lambda: _decode(path)),
            _timed(lambda: analyse(path, PipelineSettings())),
        )
        for _ in range(_ROUNDS)
    ]
    print('one tray')
    _print(filmed['frames'], [min(seconds) for seconds in zip(*rounds, strict=True)])


def _print_plate(bag: Path) -> None:
    # A separate process, so that its memory is that of the analysis.
    call = f'from benchmarks.offline import measure_plate; measure_plate({str(bag)!r})'
    done = subprocess.run([sys.executable, '-c', call], check=True, stdout=subprocess.PIPE)
    frames, seconds, before, third, peak = json.loads(done.stdout)
    print(f'\neight trays, everything on, {frames / 30.0:.0f} s')
    _print(frames, seconds)
    print(
        f'peak memory    {peak:7.0f} MB  ({before:.0f} MB before the first frame, {third:.0f} MB '
        'after a third of them)'
    )


def _print(frames: int, seconds: list[float]) -> None:
    """Print frames per second; `seconds` of OpenCV, of decoding as here and of the analysis."""
    opencv, decode, analysis = seconds
    print(f'decode only, by OpenCV {frames / opencv:7.1f} frames/s')
    print(f'decode only, as here   {frames / decode:7.1f} frames/s')
    print(f'whole analysis         {frames / analysis:7.1f} frames/s')
    print(f'ratio to OpenCV        {opencv / analysis:7.2f}  (1: as fast as decoding)')
