"""How the gas of every tray cools, in all cycles of a batch.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, TWO_COLUMNS, plain_numbers
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.studies.decays.cooling_curves import read_cycles

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.studies.batch.campaign_means import TrayMeans
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds

_MM = 1e3
# More lines than this cannot be distinguished.
_MOST = 60
_EDGES = np.geomspace(0.1, 600.0, 40)


def decays_figure(path: Path, folders: Sequence[Path], trays: Sequence[TrayMeans]) -> bool:
    """Speeds since the shaking event of each tray, their median, and Haff's law.

    Parameters
    ----------
    path : Path
        Picture to write.
    folders : sequence of Path
        Results of recordings.
    trays : sequence of TrayMeans

    Returns
    -------
    bool
        Whether there was anything to draw.

    Raises
    ------
    RecordingError
        When the picture cannot be written.
    """
    drawn = [(means, _cycles(folders, means.tray)) for means in trays if means.cycles]
    drawn = [(means, cycles) for means, cycles in drawn if cycles]
    if not drawn:
        return False
    columns = 1 if len(drawn) == 1 else 2
    rows = math.ceil(len(drawn) / columns)
    with figure_file(path, TWO_COLUMNS, 8.0 + 58.0 * rows) as figure:
        panels = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for axes, (means, cycles) in zip(panels, drawn, strict=False):
            _draw(axes, means, cycles)
        for axes in panels[len(drawn) :]:
            axes.set_axis_off()
        for axes in panels[max(len(drawn) - columns, 0) : len(drawn)]:
            axes.set_xlabel('time since the shaking event [s]')
            axes.tick_params(labelbottom=True)
    return True


def _cycles(folders: Sequence[Path], tray: int) -> list[CycleSpeeds]:
    """At most `_MOST` cycles, evenly over all recordings."""
    step = max(1, math.ceil(len(folders) / _MOST))
    cycles: list[CycleSpeeds] = []
    for folder in folders[::step]:
        try:
            cycles += read_cycles(folder / f'tray_{tray}_speed.csv')
        except RecordingError:
            # The recording has no cycle of this tray.
            continue
    return cycles[:: max(1, math.ceil(len(cycles) / _MOST))]


def _draw(axes: Axes, means: TrayMeans, cycles: Sequence[CycleSpeeds]) -> None:
    lines = [np.column_stack((cycle.times, _MM * cycle.speed)) for cycle in cycles]
    axes.add_collection(LineCollection(lines, colors=MEASURED, linewidths=0.5, alpha=0.35))
    times, speeds = _median(cycles)
    axes.plot(times, _MM * speeds, color=MEASURED, lw=2.0, label='median')
    start, tau = means.means['initial_speed'], means.means['haff_time']
    if start.cycles and tau.cycles:
        law = _MM * start.mean / (1.0 + times / tau.mean)
        axes.plot(times, law, color=FITTED, lw=1.2, ls='--', label="Haff's law, mean v0 and tau")
    axes.set_xscale('log')
    axes.set_yscale('log')
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.autoscale_view()
    axes.set_ylabel('mean speed [mm/s]')
    some = '' if len(cycles) >= means.cycles else f', {len(cycles)} of them drawn'
    axes.set_title(f'Tray {means.tray}: {counted(means.cycles, "cycle")}{some}')
    axes.grid(alpha=0.25)
    axes.legend()


def _median(cycles: Sequence[CycleSpeeds]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    times = np.concatenate([cycle.times for cycle in cycles])
    speeds = np.concatenate([cycle.speed for cycle in cycles])
    places = np.digitize(times, _EDGES)
    inside = [k for k in range(1, _EDGES.size) if (places == k).any()]
    return (
        np.array([np.median(times[places == k]) for k in inside]),
        np.array([np.median(speeds[places == k]) for k in inside]),
    )
