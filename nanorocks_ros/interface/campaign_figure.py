"""The figure of an analysis: speeds of all cycles, and the restitution of each.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_MM = 1e3
_CYCLE, _BEADS, _TOGETHER = '#30506f', '#30506f', '#c23b22'
_HEIGHT, _WIDTH = 3.2, 11.0


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
    figure = Figure(figsize=(_WIDTH, _HEIGHT * len(trays)), layout='constrained')
    rows = figure.subplots(len(trays), 2, squeeze=False, width_ratios=(3, 2))
    for (decay, restitution), tray in zip(rows, trays, strict=True):
        _draw_speeds(decay, speeds[(speeds['tray'] == tray) & (speeds['cycle'] > 0)])
        own = combined[combined['tray'] == tray]
        _draw_cycles(restitution, cor[cor['tray'] == tray], own)
        decay.set_title(f'tray {tray}', loc='left', fontsize=10)
    rows[-1, 0].set_xlabel('time since the shaking event [s]')
    rows[-1, 1].set_xlabel('cycle')
    return figure


def _draw_speeds(axes: Axes, speeds: pd.DataFrame) -> None:
    cycles = list(speeds.groupby(['recording', 'cycle']))
    for _, own in cycles:
        axes.plot(
            own['time'] - own['cycle_start'],
            _MM * own['mean_projected_speed'],
            color=_CYCLE,
            lw=0.8,
            alpha=max(0.15, min(0.9, 4.0 / len(cycles))),
        )
    axes.set_ylabel('mean projected speed [mm/s]')
    axes.set_ylim(0.0, None)
    axes.grid(alpha=0.25)


def _draw_cycles(axes: Axes, cor: pd.DataFrame, together: pd.DataFrame) -> None:
    known = cor[np.isfinite(cor['restitution'])].reset_index(drop=True)
    places = np.arange(1, len(known) + 1)
    if len(together) and np.isfinite(float(together['restitution'].iloc[0] or np.nan)):
        row = together.iloc[0]
        ends = row['restitution_lower'], row['restitution_upper']
        axes.axhspan(*ends, color=_TOGETHER, alpha=0.2)
        axes.axhline(row['restitution'], color=_TOGETHER, lw=1.5, label='all cycles together')
        axes.legend(frameon=False, fontsize=9)
    for suffix, width in (('', 1.0), ('_68', 3.0)):
        axes.vlines(
            places,
            known[f'restitution_lower{suffix}'],
            known[f'restitution_upper{suffix}'],
            color=_BEADS,
            lw=width,
        )
    axes.plot(places, known['restitution'], 'o', ms=5, color=_BEADS)
    axes.set_ylabel('restitution of beads')
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0.5, max(len(known), 1) + 0.5)
    axes.grid(alpha=0.25)
