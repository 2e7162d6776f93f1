"""The figure of a measured film: speeds over time, and speeds after and before contacts.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, SKY, TWO_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

_MM = 1e3
# The kind of contacts, whose restitution is drawn, and what a panel calls them.
_PANELS = (
    ('collision', 'beads', 'collisions of two beads'),
    ('rebound', 'walls', 'rebounds from walls'),
)


def measure_figure(
    path: Path | None,
    speeds: Mapping[str, NDArray[Any]],
    contacts: Mapping[str, NDArray[Any]],
    restitutions: Mapping[str, NDArray[Any]],
) -> Figure:
    """Draw the speeds, and both kinds of contacts.

    Parameters
    ----------
    path : Path or None
        Picture to write; None: none.
    speeds, contacts, restitutions : mapping of str to ndarray
        Columns of the tables of a tray, as of `tray_tables`: in m, drawn in mm, or in px.

    Raises
    ------
    RecordingError
        When the picture cannot be written.
    """
    end, unit, scale = ('_px', 'px', 1.0) if 'mean_speed_px' in speeds else ('', 'mm', _MM)
    with figure_file(path, TWO_COLUMNS, 62.0) as figure:
        time, *panels = figure.subplots(1, 1 + len(_PANELS))
        rms, mean = (scale * speeds[f'{name}_speed{end}'] for name in ('rms', 'mean'))
        time.plot(speeds['time'], rms, lw=0.8, color=SKY, label='root mean square')
        time.plot(speeds['time'], mean, color=MEASURED, label='mean')
        time.set(xlabel='time [s]', ylabel=f'speed of the beads [{unit}/s]', ylim=(0.0, None))
        time.legend()
        known = dict(zip(restitutions['partner'], restitutions['restitution'], strict=True))
        for axes, (kind, partner, title) in zip(panels, _PANELS, strict=True):
            own = contacts['kind'] == kind
            before, after = (
                scale * contacts[f'speed_{when}{end}'][own] for when in ('before', 'after')
            )
            axes.set(
                title=f'{own.sum()} {title}',
                xlabel=f'normal speed before [{unit}/s]',
                ylabel=f'after [{unit}/s]',
            )
            _scatter(axes, before, after, float(known[partner]))
    return figure


def _scatter(
    axes: Axes, before: NDArray[np.float64], after: NDArray[np.float64], restitution: float
) -> None:
    """Speeds after contacts over those before, and the line of the restitution."""
    if not before.size:
        axes.text(0.5, 0.5, 'none seen', transform=axes.transAxes, ha='center')
        return
    axes.plot(before, after, '.', ms=3, alpha=0.6, color=MEASURED)
    if not math.isnan(restitution):
        ends = np.array([0.0, before.max()])
        axes.plot(ends, restitution * ends, color=FITTED, label=f'restitution {restitution:.3f}')
        axes.legend(loc='upper left')
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
