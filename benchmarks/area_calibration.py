"""The binarised area over the truth, before and after it is calibrated by marks of ten beads.

One cycle of the whole plate with all effects (JPEG 85), from 7 mm/s down. The marks are true
places of ten beads in every third frame, off by 0.7 px as those of a hand are; what they make of
the area holds for the film that they were made in.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.scene_bag import SCALE, film_scene, settings
from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.plate import regions_on_plate
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.study.area_calibration import calibrate_area
from nanorocks_ros.study.bag_frames import BagFrames
from nanorocks_ros.study.manual_tracks import ManualTracks
from nanorocks_ros.study.offline import analyse
from nanorocks_ros.study.speeds import ComparedSpeeds
from nanorocks_ros.wire.beads import beads_from_array

_TRAYS = (1, 3, 5, 7)
_READINGS = {
    'as the default reads it': {},
    'means of 3 frames, 20 sigma': {'averaged_frames': 3, 'threshold': 20.0},
}
_MARKED, _EVERY, _JITTER_PX, _SEED = 10, 3, 0.7, 3
_SHAPE = (1080, 1920)
_FIRST_MARKED = 33
_MM = 1e3


def table(bag: Path) -> list[str]:
    """Lines of the table."""
    marks = {number: _marks(bag, number) for number in _TRAYS}
    lines = [
        '| tray | reading | area / truth (sd) | factor (error) | offset [mm/s] | calibrated |',
        '| --- | --- | --- | --- | --- | --- |',
    ]
    for number in _TRAYS:
        for name, reading in _READINGS.items():
            raw = _ratios(bag, number, **reading)
            try:
                found = calibrate_area(bag, marks[number], settings((number,), **reading))
            except FitError as error:
                lines.append(f'| {number} | {name} | {raw} | {error.what.split(" (")[0]} | | |')
                continue
            fit = found.fits[number]
            values = {'area_factor': fit.factor, 'area_offset': fit.offset}
            lines.append(
                f'| {number} | {name} | {raw} | {fit.factor:.2f} ({fit.factor_error:.2f}) | '
                f'{_MM * fit.offset:.2f} | {_ratios(bag, number, **reading, **values)} |'
            )
    return lines


def _ratios(bag: Path, number: int, **speed: float) -> str:
    found = analyse(bag, settings((number,), method='binarised_area', **speed)).trays[number]
    compared = ComparedSpeeds(
        tray=load_trays()[number], speeds={'area': found.speeds}, truth=found.truth
    )
    ratios = compared.ratios('area', 1)
    count = sum(one.cycle == 1 for one in found.speeds)
    known = '' if ratios.size > 0.8 * count else f', {ratios.size / count:.0%} known'
    return f'{ratios.mean():.2f} ({ratios.std():.2f}){known}' if ratios.size else 'unknown'


def _marks(path: Path, number: int) -> ManualTracks:
    """Where somebody would mark beads in the frames of the bag."""
    bag = BagFrames(path)
    epoch_ns, view = bag.epoch_ns(), bag.view()
    trays = load_trays()
    region = regions_on_plate(trays.values(), _SHAPE, SCALE)[number]
    rng = np.random.default_rng(_SEED)
    chosen = rng.choice(trays[number].count, _MARKED, replace=False)
    topic = f'/nanorocks/tray_{number}/beads'
    frames, places = [], []
    for frame, message in enumerate(bag.reader.messages([topic])):
        if frame % _EVERY or frame < _FIRST_MARKED:
            continue
        data = bag.reader.deserialize(message).data
        beads = beads_from_array(data, tray=number, epoch_ns=epoch_ns, where=topic)
        straight = (beads.positions[chosen, :2] + beads.displacement) * SCALE
        seen = view.source(straight + np.array([region.x, region.y]))
        frames.append(frame)
        places.append(seen + rng.normal(0.0, _JITTER_PX, seen.shape))
    return ManualTracks(
        np.repeat(np.array(frames, dtype=np.int64), _MARKED),
        np.tile(np.arange(_MARKED, dtype=np.int64), len(frames)),
        np.concatenate(places),
    )


def report() -> None:
    """Print the table."""
    with TemporaryDirectory() as folder:
        bag = Path(folder) / 'scene'
        film_scene(bag)
        print('\n'.join(table(bag)))
