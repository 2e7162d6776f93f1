"""The figure of an analysis: speeds of all cycles, and the restitution of each.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, TWO_COLUMNS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MM = 1e3
# Height of a row, [mm].
_HEIGHT = 55.0


def campaign_figure(speeds: pd.DataFrame, cor: pd.DataFrame, combined: pd.DataFrame) -> Figure:
    """Draw a row for each tray.

    On the left is the mean speed of every cycle since its shaking event, on the right its
    restitution, with intervals of 68 (thick) and 95 %, and that of all cycles together.

    Parameters
    ----------
    speeds, cor, combined : DataFrame
        As of `AnalysisResult`.
    """
    trays = sorted(set(speeds['tray']) | set(cor['tray'])) or [0]
    with figure_file(None, TWO_COLUMNS, _HEIGHT * len(trays)) as figure:
        rows = figure.subplots(len(trays), 2, squeeze=False, width_ratios=(3, 2))
        for (decay, restitution), tray in zip(rows, trays, strict=True):
            _draw_speeds(decay, speeds[(speeds['tray'] == tray) & (speeds['cycle'] > 0)])
            own = combined[combined['tray'] == tray]
            _draw_cycles(restitution, cor[cor['tray'] == tray], own)
            decay.set_title(f'tray {tray}')
        rows[-1, 0].set_xlabel('time since the shaking event [s]')
        rows[-1, 1].set_xlabel('cycle, counted over all recordings')
    return figure


def _draw_speeds(axes: Axes, speeds: pd.DataFrame) -> None:
    cycles = list(speeds.groupby(['recording', 'cycle']))
    for _, own in cycles:
        axes.plot(
            own['time'] - own['cycle_start'],
            _MM * own['mean_projected_speed'],
            color=MEASURED,
            lw=0.7,
            alpha=max(0.15, min(0.9, 4.0 / len(cycles))),
        )
    axes.set_ylabel('mean projected speed [mm/s]')
    axes.set_ylim(0.0, None)
    axes.grid(visible=True)


def _draw_cycles(axes: Axes, cor: pd.DataFrame, together: pd.DataFrame) -> None:
    known = cor[np.isfinite(cor['restitution'])].reset_index(drop=True)
    places = np.arange(1, len(known) + 1)
    if len(together) and np.isfinite(float(together['restitution'].iloc[0] or np.nan)):
        row = together.iloc[0]
        ends = row['restitution_lower'], row['restitution_upper']
        axes.axhspan(*ends, color=FITTED, alpha=0.2)
        axes.axhline(row['restitution'], color=FITTED, lw=1.5, label='all cycles together')
        axes.legend()
    for suffix, width in (('', 1.0), ('_68', 3.0)):
        axes.vlines(
            places,
            known[f'restitution_lower{suffix}'],
            known[f'restitution_upper{suffix}'],
            color=MEASURED,
            lw=width,
        )
    axes.plot(places, known['restitution'], 'o', color=MEASURED)
    axes.set_ylabel('restitution of beads')
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlim(0.5, max(len(known), 1) + 0.5)
    axes.grid(visible=True)
