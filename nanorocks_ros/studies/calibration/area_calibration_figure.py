"""Figure of a calibration of the binarised area: manual speeds over its speeds.

Tested by ``test/studies/calibration/test_area_calibration.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, GREY, MEASURED, ONE_COLUMN

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.axes import Axes

    from nanorocks_ros.studies.calibration.area_fit import AreaFit

_MM = 1e3


def area_calibration_figure(path: Path, fits: Mapping[int, AreaFit]) -> None:
    """Draw the speed pairs of each tray, and the fitted line.

    Parameters
    ----------
    path : Path
    fits : mapping of int to AreaFit
        Fits by tray.

    Raises
    ------
    RecordingError
        When the picture cannot be written.
    """
    columns = min(len(fits), 2)
    rows = -(-len(fits) // columns)
    with figure_file(path, columns * ONE_COLUMN, rows * ONE_COLUMN) as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, (number, fit) in zip(panels, sorted(fits.items()), strict=False):
            _draw(axes, number, fit)
        for axes in panels[len(fits) :]:
            axes.set_axis_off()


def _draw(axes: Axes, number: int, fit: AreaFit) -> None:
    area_speed = _MM * np.array([pair.area_speed for pair in fit.pairs])
    area_error = _MM * np.array([pair.area_speed_error for pair in fit.pairs])
    axes.errorbar(
        area_speed,
        [_MM * pair.manual_speed for pair in fit.pairs],
        xerr=area_error,
        yerr=[_MM * pair.manual_speed_error for pair in fit.pairs],
        fmt='o',
        ms=4,
        lw=0.8,
        color=MEASURED,
        label=f'{fit.windows} windows',
    )
    max_speed = 1.05 * float((area_speed + area_error).max())
    line = np.array([0.0, max_speed])
    sign = '−' if fit.offset < 0.0 else '+'
    is_fitted = math.isfinite(fit.offset_error)
    offset = f' {sign} {_MM * abs(fit.offset):.2f} mm/s' if is_fitted else ''
    axes.plot(
        line,
        fit.factor * line + _MM * fit.offset,
        color=FITTED,
        lw=1.8,
        label=f'{fit.factor:.3g} $\\times$ area{offset}',
    )
    axes.plot(line, line, color=GREY, ls='--', lw=1.2, label='no calibration needed')
    axes.set_xlim(0.0, max_speed)
    axes.set_ylim(0.0, 1.3 * _MM * fit.fastest)
    axes.set_title(f'tray {number}')
    axes.set_xlabel('speed by the binarised area [mm/s]')
    axes.set_ylabel('mean projected speed by hand [mm/s]')
    axes.legend()
    axes.grid(alpha=0.25)
