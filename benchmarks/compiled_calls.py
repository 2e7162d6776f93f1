"""Compiled functions that Python calls for a frame of the plate: how often, and their time.

Processor time of the thread, with the way into the function and back: its arguments are looked at
and its arrays are wrapped at each call. OFFLINE_PLATE_BAG names a film of the plate, otherwise one
of 12 s is made. Decoding is left out, as is the first second of the film.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import defaultdict
from typing import TYPE_CHECKING, Any

from numba.core.dispatcher import Dispatcher

from benchmarks.live_plate import PLATE, filmed_plate
from benchmarks.offline import warm
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType

_SECONDS = 12.0
_WARM_UP_FRAMES = 30
_ROWS = 30


class _CallMeter:
    """Counts and times the calls of compiled functions by the modules of the package."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)
        self.running = False
        self._timed: dict[int, Callable[..., Any]] = {}
        self._replaced: list[tuple[ModuleType, str, Any]] = []

    def __enter__(self) -> _CallMeter:
        """Put a clock before every compiled function that a loaded module calls by its name."""
        for name, module in list(sys.modules.items()):
            if not name.startswith('nanorocks_ros.'):
                continue
            for attribute, value in list(vars(module).items()):
                if isinstance(value, Dispatcher):
                    timed = self._timed.setdefault(id(value), self._with_clock(value))
                    self._replaced.append((module, attribute, value))
                    setattr(module, attribute, timed)
        return self

    def __exit__(self, *_: object) -> None:
        for module, attribute, value in self._replaced:
            setattr(module, attribute, value)

    def _with_clock(self, function: Any) -> Callable[..., Any]:
        module = function.py_func.__module__.rpartition('.')[2]
        name = f'{module} {function.py_func.__name__}'

        def timed(*arguments: Any) -> Any:
            if not self.running:
                return function(*arguments)
            start = time.thread_time()
            result = function(*arguments)
            self.spent[name] += time.thread_time() - start
            self.calls[name] += 1
            return result

        return timed


def report() -> None:
    """Print the functions that take longest."""
    with tempfile.TemporaryDirectory() as folder:
        bag = filmed_plate(folder, _SECONDS, os.environ.get('OFFLINE_PLATE_BAG', ''))
        warm()
        _print_calls(bag)


def _print_calls(bag: Path) -> None:
    # Whatever is not compiled yet must be before the clocks: compiled functions cannot call them.
    _push_all(bag, None)
    with _CallMeter() as meter:
        spent, frames = _push_all(bag, meter)
    unit = 1e3 / frames
    share = sum(meter.spent.values()) / spent
    calls = sum(meter.calls.values()) / frames
    print(f'{unit * spent:.1f} ms a frame without decoding, {frames} frames')
    print(f'{calls:.0f} calls of compiled functions, {share:.2f} of the time')
    print('| function | ms a frame | calls a frame | us a call |')
    print('| --- | --- | --- | --- |')
    for name, seconds in sorted(meter.spent.items(), key=lambda item: -item[1])[:_ROWS]:
        count = meter.calls[name]
        per_call = 1e6 * seconds / count
        print(f'| {name} | {unit * seconds:.2f} | {count / frames:.1f} | {per_call:.0f} |')


def _push_all(bag: Path, meter: _CallMeter | None) -> tuple[float, int]:
    """Analyse the film; processor time and number of the frames after the first second."""
    pipeline = Pipeline(with_values(PipelineSettings(), PLATE, 'benchmark'), str(bag))
    spent, frames = 0.0, 0
    for number, frame in enumerate(BagFrames(bag).frames()):
        metered = number >= _WARM_UP_FRAMES
        if meter is not None:
            meter.running = metered
        start = time.process_time()
        pipeline.push(frame)
        if metered:
            spent += time.process_time() - start
            frames += 1
    return spent, frames
