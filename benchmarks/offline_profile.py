"""Where the offline analysis spends its time: samples of the call stack by processor time.

cProfile doubles the time of the plate, most of it in small functions; samples do not.
OFFLINE_PROFILE_BAG names a film, of the plate where OFFLINE_PROFILE_PLATE is set; otherwise that
of one tray of `offline` is made.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.live_plate import PLATE
from benchmarks.offline import warm
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag

if TYPE_CHECKING:
    from types import FrameType

_SECONDS = 10.0
_INTERVAL_S = 0.002
_ROWS = 40


class _Samples:
    """How often each function was on the stack, and how often it was the one that ran."""

    def __init__(self) -> None:
        self.count = 0
        self.inclusive: Counter[str] = Counter()
        self.own: Counter[str] = Counter()

    def take(self, number: int, frame: FrameType | None) -> None:
        """Count the functions on the stack."""
        del number
        names = []
        while frame is not None:
            code = frame.f_code
            place = code.co_filename.rpartition('nanorocks_ros/')[2]
            names.append(f'{"/".join(place.split("/")[-3:])} {code.co_name}')
            frame = frame.f_back
        self.count += 1
        self.own[names[0]] += 1
        self.inclusive.update(set(names))


def report() -> None:
    """Print the functions that take longest."""
    warm()
    with tempfile.TemporaryDirectory() as folder:
        bag = os.environ.get('OFFLINE_PROFILE_BAG', '')
        if not bag:
            bag = str(Path(folder) / 'run')
            film_into_bag(
                Path(bag),
                SimulationSettings(),
                duration=_SECONDS,
                quality=90,
                progress=lambda *_: None,
            )
        values = PLATE if os.environ.get('OFFLINE_PROFILE_PLATE') else {}
        _print_profile(bag, with_values(PipelineSettings(), values, 'benchmark'))


def _print_profile(bag: str, settings: PipelineSettings) -> None:
    samples = _Samples()
    signal.signal(signal.SIGPROF, samples.take)
    signal.setitimer(signal.ITIMER_PROF, _INTERVAL_S, _INTERVAL_S)
    start = time.process_time()
    frames = analyse(bag, settings).frames
    spent = time.process_time() - start
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    unit = 1e3 * spent / frames / samples.count
    print(f'{1e3 * spent / frames:.2f} ms per frame, {frames} frames, {samples.count} samples')
    print('| function | ms per frame | itself |')
    print('| --- | --- | --- |')
    for name, count in samples.inclusive.most_common(_ROWS):
        print(f'| {name} | {unit * count:.2f} | {unit * samples.own[name]:.2f} |')
