"""Figure 7 as the paper draws it: energy by the calibrated area from the shaking event on.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, PAPER, TRUTH, TWO_COLUMNS
from nanorocks_ros.outputs.html_report import with_error
from nanorocks_ros.physics.haff_law import granular_energy, haff_speed
from nanorocks_ros.physics.paper_formulas import RELATIVE_TO_MEAN_SPEED
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE
from nanorocks_ros.studies.reproduction.marked_calibration import (
    area_series,
    calibrated,
    calibrated_decay,
    marked_fit,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles

_NANO = 1e9


def energy_figure(path: Path, cycle: CycleFiles, tray: Tray) -> None:
    """Draw the energy at twice the mean speed over a cycle, and its fit by Haff's law.

    Raises
    ------
    FitError
        When the area cannot be calibrated, or its speeds do not fall.
    """
    fit = marked_fit(cycle, tray)
    series = calibrated(area_series(cycle, tray.number), fit)
    first, haff = calibrated_decay(cycle, tray, fit)
    with figure_file(path, TWO_COLUMNS, 95.0) as figure:
        axes: Any = figure.subplots()
        truth = cycle.tray(tray.number)['truth']
        times = np.array(truth['time']) - FIRST_SHAKE
        after = times > 0.0
        speeds = np.array(truth['mean_projected_speed'], dtype=np.float64)
        axes.plot(times[after], _energy(speeds[after], tray), color=TRUTH, lw=4, alpha=0.5,
                  label='truth')  # fmt: skip
        axes.plot(series.times, _energy(series.speed, tray), '.', ms=3, color=MEASURED,
                  label='calibrated area')  # fmt: skip
        start = np.linspace(0.0, float(series.times[-1]), 300)
        initial = float(_energy(np.array([haff.initial_speed]), tray)[0])
        initial_error = 2.0 * initial * haff.initial_speed_error / haff.initial_speed
        axes.plot(
            start + first,
            _energy(haff_speed(start, haff.initial_speed, haff.haff_time), tray),
            color=FITTED,
            lw=1.5,
            label=f'fit: T0 = {with_error(initial, initial_error)} nJ, '
            f'τ = {with_error(haff.haff_time, haff.haff_time_error)} s',
        )
        energy, time = _NANO * reported.PAPER_ENERGY, reported.PAPER_HAFF_TIME
        axes.plot(start, energy / (1.0 + start / time) ** 2, '--', color=PAPER, lw=1,
                  label=f'the paper: T0 = {energy:.2g} nJ, τ = {time:g} s')  # fmt: skip
        axes.set(xlabel='time since the shaking event [s]',
                 ylabel='energy at twice the mean speed [nJ]', yscale='log')  # fmt: skip
        axes.set_xlim(0.0, float(series.times[-1]))
        axes.grid(alpha=0.25)
        axes.legend()


def _energy(speeds: NDArray[np.float64], tray: Tray) -> NDArray[np.float64]:
    """Energy at the relative speed of the paper, [nJ]."""
    mass = tray.mean_mass
    return np.array(
        [_NANO * granular_energy(RELATIVE_TO_MEAN_SPEED * speed, mass) for speed in speeds]
    )
