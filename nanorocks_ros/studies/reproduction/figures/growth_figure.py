"""Figure 8e: growth of the clusters of a tray over a cycle, and its derivative.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import MEASURED, PAPER, TRUTH, TWO_COLUMNS
from nanorocks_ros.physics.paper_clusters import paper_calibration
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles

# The end of a cycle, and the time over which the curve of the derivative is averaged, [s].
_END, _SMOOTHED = 2.0, 1.0


def growth_figure(path: Path, cycles: Sequence[CycleFiles], tray: int) -> None:
    """Draw the cluster size over the first cycle, calibrated by the ends of all.

    Without the rule of the paper where no cycle ends with clusters, which calibrate it.
    """
    cycle = cycles[0]
    table = _table(cycle, tray)
    after = table['time'] > FIRST_SHAKE
    times = table['time'][after] - FIRST_SHAKE
    size = table['level_area'][after] * _beads_per_area(cycles, tray)
    with figure_file(path, TWO_COLUMNS, 110.0) as figure:
        axes: Any
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        axes.plot(times, size, color=PAPER, lw=1.2, label='the rule of the paper')
        combined = table['combined_size'][after]
        error = table['combined_size_error'][after]
        axes.plot(times, combined, color=MEASURED, lw=1.2, label='ours, averaged over beads')
        axes.fill_between(
            times, combined - error, combined + error, color=MEASURED, alpha=0.2, lw=0
        )
        truth = {
            name: np.array(values) for name, values in cycle.summary['truth'][str(tray)].items()
        }
        true_times = truth['time'] - FIRST_SHAKE
        late = true_times > 0.0
        clusters = np.where(truth['clusters'] > 0.0, truth['clusters'], np.nan)
        per_cluster = truth['beads_in_clusters'] / clusters
        axes.plot(true_times[late], truth['weighted_size'][late], color=TRUTH, lw=3, alpha=0.6,
                  label='truth, averaged over beads')  # fmt: skip
        axes.plot(true_times[late], per_cluster[late], '--', color=TRUTH, lw=1.5,
                  label='truth, beads per cluster')  # fmt: skip
        axes.set(ylabel='cluster size [beads]', ylim=(0.0, None))
        axes.legend()
        below.plot(times, np.gradient(_running_mean(times, size), times), color=PAPER, lw=1.2)
        below.axhline(0.0, color='0.5', lw=1)
        below.set(xlabel='time since the shaking event [s]', ylabel='dn/dt [1/s]')
        for panel in (axes, below):
            panel.grid(alpha=0.25)


def _table(cycle: CycleFiles, tray: int) -> dict[str, NDArray[np.float64]]:
    columns = 'time', 'level_area', 'combined_size', 'combined_size_error'
    return read_columns(cycle.results / f'tray_{tray}_cluster.csv', columns)


def _beads_per_area(cycles: Sequence[CycleFiles], tray: int) -> float:
    """The calibration of the paper, by the true clusters at the ends of the cycles, [1/m^2].

    NaN where no cycle ends with clusters.
    """
    areas, sizes = [], []
    for cycle in cycles:
        truth = cycle.summary['truth'][str(tray)]
        if truth['clusters'][-1]:
            table = _table(cycle, tray)
            end = table['time'] > table['time'][-1] - _END
            areas.append(float(np.nanmean(table['level_area'][end])))
            sizes.append(truth['beads_in_clusters'][-1] / truth['clusters'][-1])
    if not sizes:
        return math.nan
    return paper_calibration(np.array(areas), math.fsum(sizes) / len(sizes)).beads_per_area


def _running_mean(times: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of the values around each time."""
    return np.array([values[np.abs(times - time) <= 0.5 * _SMOOTHED].mean() for time in times])
