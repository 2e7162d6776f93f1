"""Figure of a calibration of the binarised area: manual speeds over its speeds.

Tested by ``test/studies/calibration/test_area_calibration.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from nanorocks_ros.outputs.atomic_files import atomic_file

mpl.use('Agg')
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.axes import Axes

    from nanorocks_ros.studies.calibration.area_fit import AreaFit

_MM = 1e3
_MEASURED, _FIT, _IDENTITY = '#30506f', '#c23b22', '#8a8a8a'
_SIDE, _DPI = 5.0, 110


def area_figure(path: Path, fits: Mapping[int, AreaFit]) -> None:
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
    figure = Figure(figsize=(_SIDE * len(fits), _SIDE), layout='constrained')
    panels = figure.subplots(1, len(fits), squeeze=False)[0]
    for axes, (number, fit) in zip(panels, sorted(fits.items()), strict=True):
        _draw(axes, number, fit)
    with atomic_file(path) as part:
        figure.savefig(part, dpi=_DPI)


def _draw(axes: Axes, number: int, fit: AreaFit) -> None:
    area_speed = _MM * np.array([pair.area_speed for pair in fit.pairs])
    axes.errorbar(
        area_speed,
        [_MM * pair.manual_speed for pair in fit.pairs],
        xerr=[_MM * pair.area_speed_error for pair in fit.pairs],
        yerr=[_MM * pair.manual_speed_error for pair in fit.pairs],
        fmt='o',
        ms=4,
        lw=0.8,
        color=_MEASURED,
        label=f'{fit.windows} windows',
    )
    max_speed = float(area_speed.max()) * 1.1
    line = np.array([0.0, max_speed])
    offset = f' {_MM * fit.offset:+.2f} mm/s' if math.isfinite(fit.offset_error) else ''
    axes.plot(
        line,
        fit.factor * line + _MM * fit.offset,
        color=_FIT,
        lw=1.8,
        label=f'{fit.factor:.3g} $\\times$ area{offset}',
    )
    axes.plot(line, line, color=_IDENTITY, ls='--', lw=1.2, label='no calibration needed')
    axes.set_xlim(0.0, max_speed)
    axes.set_ylim(0.0, 1.3 * _MM * fit.fastest)
    axes.set_title(f'tray {number}', loc='left', fontsize=10)
    axes.set_xlabel('speed by the binarised area [mm/s]')
    axes.set_ylabel('mean projected speed by hand [mm/s]')
    axes.legend(frameon=False, fontsize=8)
    axes.grid(alpha=0.25)
