"""Calibration of the binarised area by ten beads of each species, marked in one cycle.

The paper marked these beads by hand; here their true speeds are taken, without marking errors.

Tested by ``test/studies/reproduction/test_marked_calibration.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.physics.paper_formulas import paper_restitution_of_decay
from nanorocks_ros.studies.calibration.area_fit import SpeedPair, fit_area
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE
from nanorocks_ros.studies.reproduction.campaign_truth import MARKED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.haff_fit import HaffFit
    from nanorocks_ros.studies.calibration.area_fit import AreaFit
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles

# Length of a window of the area: ten averaged frames and the ten before, [s].
_WINDOW = 20.0 / 30.0
# Time after the shaking event in which the speeds fall ([B19] section 3.1.1), [s].
_DAMPED = 20.0


class AreaSeries(NamedTuple):
    """Speeds by the binarised area after a shaking event.

    `times`: since the event, (n,), [s]; `speed`, `error`: (n,), [m/s].
    """

    times: NDArray[np.float64]
    speed: NDArray[np.float64]
    error: NDArray[np.float64]


def area_series(cycle: CycleFiles, tray: int) -> AreaSeries:
    """The speeds of a tray by the binarised area, not calibrated."""
    results = cycle.tray(tray, 'paper')
    columns = np.array(
        [results[name] for name in ('time', 'mean_projected_speed', 'mean_projected_speed_error')],
        dtype=np.float64,
    )
    columns[0] -= FIRST_SHAKE
    known = np.isfinite(columns).all(axis=0) & (columns[0] > 0.0)
    return AreaSeries(*columns[:, known])


def marked_fit(cycle: CycleFiles, tray: Tray) -> AreaFit:
    """Factor and offset of the binarised area from the marked beads of a cycle.

    Raises
    ------
    FitError
        When the area does not follow the speed of the marked beads.
    """
    series = area_series(cycle, tray.number)
    truth = cycle.summary['truth'][str(tray.number)]
    times, marked = np.array(truth['time']) - FIRST_SHAKE, np.array(truth['marked_speed'])
    pairs: list[SpeedPair] = []
    last = -math.inf
    for time, speed, error in zip(*series, strict=True):
        near = marked[np.abs(times - time) <= 0.5 * _WINDOW]
        if time - last < _WINDOW or near.size < 2 or not near.mean() > 0.0:
            continue
        last = time
        pairs.append(
            SpeedPair(
                stamp_ns=round(1e9 * time),
                area_speed=float(speed),
                area_speed_error=float(error),
                manual_speed=float(near.mean()),
                manual_speed_error=float(near.std(ddof=1) / math.sqrt(near.size)),
                beads=min(MARKED * len(tray.species), tray.count),
            )
        )
    return fit_area(pairs, tray.count, f'tray {tray.number}')


def calibrated(series: AreaSeries, fit: AreaFit) -> AreaSeries:
    """The speeds after the calibration; errors are those of the area."""
    return AreaSeries(
        series.times, fit.factor * series.speed + fit.offset, fit.factor * series.error
    )


class CalibratedDecay(NamedTuple):
    """Haff's law fitted to calibrated speeds.

    `start`: of its time, since the shaking event, [s]; `haff`: the fit.
    """

    start: float
    haff: HaffFit


def calibrated_decay(cycle: CycleFiles, tray: Tray, fit: AreaFit) -> CalibratedDecay:
    """Haff's law from the first speed on, for the 20 s in which the speeds fall in the paper.

    Raises
    ------
    FitError
        When the calibrated speeds are no decay.
    """
    series = calibrated(area_series(cycle, tray.number), fit)
    used = (series.times <= _DAMPED) & (series.speed > 0.0) & (series.error > 0.0)
    times, speed, error = (values[used] for values in series)
    if not times.size:
        raise FitError(f'tray {tray.number}', 'no calibrated speed is above 0', 'mark more beads')
    first = float(times[0])
    return CalibratedDecay(first, fit_haff(times - first, speed, error, tray.count))


def calibrated_restitution(cycle: CycleFiles, tray: Tray, fit: AreaFit) -> float:
    """Restitution by the closed form of the paper from calibrated speeds; NaN without one."""
    try:
        rate = calibrated_decay(cycle, tray, fit).haff.decay_rate
    except FitError:
        return math.nan
    # 0: the decay is faster than the form allows.
    return paper_restitution_of_decay(rate, tray.diameter, tray.number_density) or math.nan
