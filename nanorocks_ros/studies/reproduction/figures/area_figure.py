"""Figure 5: the area that a displaced disc uncovers, and the speed of tray 3 by that area.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Circle

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import GREEN, TRUTH, TWO_COLUMNS, VERMILION
from nanorocks_ros.physics.moving_area import moving_area
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE
from nanorocks_ros.studies.reproduction.marked_calibration import (
    area_series,
    calibrated,
    marked_fit,
)

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles

_MM = 1e3
_TRAY = 3
# Displacement in the schematic, in radii.
_SHIFT = 0.7
_AREA, _BY_HAND = VERMILION, GREEN


def area_figure(path: Path, cycle: CycleFiles) -> None:
    """Draw the moving area and the speeds of a cycle by it."""
    with figure_file(path, TWO_COLUMNS, 60.0) as figure:
        schematic, areas, speeds = figure.subplots(1, 3, width_ratios=(1, 1.2, 2))
        _draw_schematic(schematic)
        _draw_areas(areas)
        _draw_speeds(speeds, cycle)


def _draw_schematic(axes: Axes) -> None:
    """Two discs of radius 1; what only one of them covers is striped."""
    x, y = np.meshgrid(np.linspace(-1.2, 2.0, 400), np.linspace(-1.2, 1.2, 300))
    inside = [np.hypot(x - centre, y) < 1.0 for centre in (0.0, _SHIFT)]
    moving = np.where(inside[0] ^ inside[1], 1.0, np.nan)
    axes.contourf(x, y, moving, levels=(0.5, 1.5), hatches=['////'], colors=['#f3d9d5'])
    for centre, style, time in ((0.0, '--', 't'), (_SHIFT, '-', 't + dt')):
        axes.add_patch(Circle((centre, 0.0), 1.0, fill=False, ls=style, lw=1.4))
        axes.annotate(time, (centre, 1.08), ha='center')
    axes.annotate('', (_SHIFT, 0.0), (0.0, 0.0), arrowprops={'arrowstyle': '<->'})
    axes.annotate('dx', (0.5 * _SHIFT, 0.1), ha='center')
    axes.annotate('', (0.0, -1.0), (0.0, 0.0), arrowprops={'arrowstyle': '<->'})
    axes.annotate('R', (0.06, -0.6))
    axes.set_aspect('equal')
    axes.set_axis_off()
    axes.set_title('a')


def _draw_areas(axes: Axes) -> None:
    shift = np.linspace(0.0, 3.0, 200)
    axes.plot(shift, moving_area(shift, 1.0), color=_AREA, label='exact')
    axes.plot(shift, 4.0 * shift, '--', color='0.3', label='4 R dx, used by the paper')
    axes.set(xlabel='dx / R', ylabel='moving area / R²', ylim=(0.0, 9.0))
    axes.grid(alpha=0.25)
    axes.legend()


def _draw_speeds(axes: Any, cycle: CycleFiles) -> None:
    truth = cycle.summary['truth'][str(_TRAY)]
    times = np.array(truth['time']) - FIRST_SHAKE
    after = times > 0.0
    axes.plot(times[after], _MM * np.array(truth['marked_speed'])[after], color=_BY_HAND, lw=1,
              label='ten beads of each kind')  # fmt: skip
    results = cycle.tray(_TRAY)['truth']
    times = np.array(results['time']) - FIRST_SHAKE
    after = times > 0.0
    axes.plot(times[after], _MM * np.array(results['mean_projected_speed'])[after], lw=4,
              alpha=0.5, color=TRUTH, label='all beads')  # fmt: skip
    series = area_series(cycle, _TRAY)
    axes.plot(series.times, _MM * series.speed, ':', color=_AREA, lw=1,
              label='area, not calibrated')  # fmt: skip
    try:
        series = calibrated(series, marked_fit(cycle, load_trays()[_TRAY]))
        axes.plot(series.times, _MM * series.speed, color=_AREA, lw=1.5, label='area, calibrated')
    except FitError as error:
        axes.text(0.5, 0.5, f'no calibration: {error.what}', transform=axes.transAxes, wrap=True)
    axes.set(xlabel='time since the shaking event [s]', ylabel='mean projected speed [mm/s]',
             ylim=(0.0, None))  # fmt: skip
    axes.set_title(f'b: tray {_TRAY}')
    axes.grid(alpha=0.25)
    axes.legend()
