"""The binarised area over the truth, before and after calibration by marks of ten beads.

One cycle of the whole plate with all effects (JPEG 85), from 7 mm/s down. The marks are true
positions of ten beads in every third frame with an error of 0.7 px, as in manual marks. The
calibration holds for the film with these marks.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.scene_bag import SCALE, film_scene, settings
from nanorocks_ros.experiment.plate import regions_on_plate
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import SpeedEstimate
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.calibration.area_calibration import calibrate_area
from nanorocks_ros.studies.calibration.manual_tracks import ManualTracks
from nanorocks_ros.studies.inspection.speed_comparison import ComparedSpeeds
from nanorocks_ros.wire.bead_truth import beads_from_array

if TYPE_CHECKING:
    from nanorocks_ros.studies.calibration.area_fit import AreaFit

# A tray, and a variant of the recipe.
_Case = tuple[int, str]
_TRAYS = (1, 3, 5, 7)
_READINGS = {
    'as the default reads it': {},
    'means of 3 frames, 20 sigma': {'averaged_frames': 3, 'threshold': 20.0},
}
_MARKED, _EVERY, _JITTER_PX, _SEED = 10, 3, 0.7, 3
_SHAPE = (1080, 1920)
_FIRST_MARKED = 33
_MM = 1e3
_NEARLY_ALL = 0.8


def table(bag: Path) -> list[str]:
    """Lines of the table."""
    marks = _marks(bag)
    fits: dict[_Case, AreaFit] = {}
    for name, reading in _READINGS.items():
        calibration = calibrate_area(bag, marks, settings(_TRAYS, **reading))
        fits |= {(number, name): fit for number, fit in calibration.fits.items()}
    raw = {(number, name): reading for number in _TRAYS for name, reading in _READINGS.items()}
    calibrated = {
        case: {**raw[case], 'area_factor': fit.factor, 'area_offset': fit.offset}
        for case, fit in fits.items()
    }
    before, after = _ratios(bag, raw), _ratios(bag, calibrated)
    lines = [
        '| tray | reading | area / truth (sd) | factor (error) | offset [mm/s] | calibrated |',
        '| --- | --- | --- | --- | --- | --- |',
    ]
    for case in raw:
        start = f'| {case[0]} | {case[1]} | {before[case]} |'
        if case not in fits:
            lines.append(f'{start} refused | | |')
            continue
        fit = fits[case]
        lines.append(
            f'{start} {fit.factor:.2f} ({fit.factor_error:.2f}) | {_MM * fit.offset:.2f} | '
            f'{after[case]} |'
        )
    return lines


def _ratios(path: Path, cases: dict[_Case, dict[str, float]]) -> dict[_Case, str]:
    """Ratio of the speed by the area to the truth after the shaking event, for each case."""
    images = BagImages(path, settings(_TRAYS))
    truth = images.bag.truth(images.epoch_ns)
    estimators = {
        case: TrayMeasurement(
            settings(_TRAYS, method='binarised_area', **speed), images.trays[case[0]]
        )
        for case, speed in cases.items()
    }
    speeds: dict[_Case, list[SpeedEstimate]] = {case: [] for case in cases}
    for shot in images.shots():
        for image in shot.images:
            for case in cases:
                if case[0] == image.tray:
                    records = estimators[case].push(image)
                    speeds[case] += [
                        record for record in records if isinstance(record, SpeedEstimate)
                    ]
    return {
        case: _cell(
            ComparedSpeeds(
                tray=images.trays[case[0]], speeds={'': estimates}, truth=truth[case[0]]
            )
        )
        for case, estimates in speeds.items()
    }


def _cell(compared: ComparedSpeeds) -> str:
    ratios = compared.ratios('', 1)
    share = ratios.size / sum(estimate.cycle == 1 for estimate in compared.speeds[''])
    share_text = '' if share > _NEARLY_ALL else f', {share:.0%} known'
    return f'{ratios.mean():.2f} ({ratios.std():.2f}){share_text}' if ratios.size else 'unknown'


def _marks(path: Path) -> ManualTracks:
    """Simulated manual marks of beads in the frames of the bag."""
    bag = BagFrames(path)
    epoch_ns, view = bag.epoch_ns(), bag.view()
    trays = load_trays()
    regions = regions_on_plate(trays.values(), _SHAPE, SCALE)
    rng = np.random.default_rng(_SEED)
    chosen = {n: rng.choice(trays[n].count, _MARKED, replace=False) for n in _TRAYS}
    frames, ids, places = [], [], []
    for number in _TRAYS:
        topic = f'/nanorocks/tray_{number}/beads'
        corner = np.array([regions[number].x, regions[number].y])
        for frame, message in enumerate(bag.reader.messages([topic])):
            if frame % _EVERY or frame < _FIRST_MARKED:
                continue
            data = bag.reader.deserialize(message).data
            beads = beads_from_array(data, tray=number, epoch_ns=epoch_ns, where=topic)
            positions = beads.positions[chosen[number], :2] + beads.displacement
            image_positions = view.source(positions * SCALE + corner)
            frames.append(np.full(_MARKED, frame))
            ids.append(number * _MARKED + np.arange(_MARKED))
            places.append(image_positions + rng.normal(0.0, _JITTER_PX, image_positions.shape))
    return ManualTracks(np.concatenate(frames), np.concatenate(ids), np.concatenate(places))


def report() -> None:
    """Print the table."""
    with TemporaryDirectory() as folder:
        bag = Path(folder) / 'scene'
        film_scene(bag)
        print('\n'.join(table(bag)))
