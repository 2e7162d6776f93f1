"""Mean projected speed from frames over the truth, tray 1, by method and speed.

Four shaken trays per mean speed, JPEG 85; the mean speeds cover the range. Each estimate is
compared with the true speed averaged over its window, and binned by the truth. The first row is
the default method, the second its stated error; variants of the paper's recipe follow.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import Frame, SpeedEstimate, TrayImage
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

_NS = 1e9
_SEEDS = range(1, 5)
_SECONDS = 22.0
_MEAN_SPEEDS = (0.0022, 0.0045, 0.0085, 0.017)
_BINS = (0.5e-3, 1e-3, 2e-3, 4e-3, 7e-3, 12e-3)
_DEFAULT = 'tracking'
_METHODS = {
    _DEFAULT: {'speed.method': 'tracking'},
    'structure function': {'speed.method': 'structure_function'},
    'lag 1, exact': {'speed.averaging': 'none'},
    'lag 1, Taylor': {'speed.averaging': 'none', 'speed.geometry': 'taylor'},
    'running mean 10, exact, dt 1/3 s': {},
    'running mean 10, Taylor, dt 1/3 s': {'speed.geometry': 'taylor'},
    'running mean 10, Taylor, dt 1/30 s': {
        'speed.geometry': 'taylor',
        'speed.time_step': 'one_frame',
    },
    'block mean 10, exact, dt 1/3 s': {'speed.averaging': 'block_mean'},
}


_OWN_ERROR = 'its own error / truth'


def _estimators() -> dict[str, TrayMeasurement]:
    estimators = {}
    for name, values in _METHODS.items():
        recipe = {'speed.method': 'binarised_area', **values}
        settings = with_values(PipelineSettings(), recipe, 'benchmark')
        estimators[name] = TrayMeasurement(settings, load_trays()[1])
    return estimators


def _recompressed(frame: Frame) -> Frame:
    jpeg = cv2.imencode('.jpg', frame.image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
    return Frame(stamp_ns=frame.stamp_ns, encoding='bgr8', image=image)


def _ratios(seed: int, mean_speed: float, ratios: dict) -> None:
    settings = SimulationSettings(seed=seed, mean_speed=mean_speed, width_px=220, height_px=220)
    estimators = _estimators()
    stages = PipelineSettings()
    preprocessor = Preprocessor(stages, trays_of(stages), 'film')
    speeds: dict[str, list[SpeedEstimate]] = {name: [] for name in estimators}
    truth = []
    for frame, true in film(settings, load_trays()[1], round(_SECONDS * settings.frame_rate)):
        truth.append((true.stamp_ns / _NS, true.mean_projected_speed))
        for image in preprocessor.push(_recompressed(frame)):
            if not isinstance(image, TrayImage):
                continue
            for name, estimator in estimators.items():
                records = estimator.push(image)
                speeds[name] += [record for record in records if isinstance(record, SpeedEstimate)]
    time, value = np.array(truth).T
    for name, estimates in speeds.items():
        for estimate in estimates:
            if estimate.cycle == 0:
                continue
            inside = np.abs(time - estimate.stamp_ns / _NS) <= 0.5 * estimate.window + 1e-6
            true = value[inside].mean()
            column = int(np.digitize(true, _BINS))
            ratios[name, column].append(estimate.mean_projected_speed.value / true)
            if name == _DEFAULT:
                ratios[_OWN_ERROR, column].append(estimate.mean_projected_speed.error / true)


def report() -> None:
    """Print the table."""
    all_ratios: dict[tuple[str, int], list[float]] = defaultdict(list)
    for mean_speed in _MEAN_SPEEDS:
        for seed in _SEEDS:
            _ratios(seed, mean_speed, all_ratios)
    edges = [f'{1e3 * low:g}-{1e3 * high:g}' for low, high in pairwise(_BINS)]
    print('| estimate / truth (sd of one estimate), at v [mm/s] | ' + ' | '.join(edges) + ' |')
    print('| --- |' + ' --- |' * len(edges))
    for name in (_DEFAULT, _OWN_ERROR, *list(_METHODS)[1:]):
        cells = []
        for number in range(1, len(_BINS)):
            ratios = np.array(all_ratios[name, number])
            finite = ratios[np.isfinite(ratios)]
            cells.append(f'{finite.mean():.3f} ({finite.std():.3f})' if finite.size else 'unknown')
        print(f'| {name} | ' + ' | '.join(cells) + ' |')
