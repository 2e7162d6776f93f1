"""Figure of growing clusters: tray images, autocorrelations, and cluster sizes over time.

Tested by ``test/studies/inspection/test_autocorrelations.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import (
    MAP,
    MEASURED,
    TRUTH,
    TWO_COLUMNS,
    VERMILION,
    plain_numbers,
)

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.studies.inspection.autocorrelations import (
        BagClusters,
        CycleClusters,
        Snapshot,
    )

_LEVELS = (0.1, 0.2, 0.3, 0.5, 0.7, 0.9)
_MM = 1e3
_HEIGHT = 88.0


def autocorrelation_figure(path: Path, clusters: BagClusters, pixels_per_metre: float) -> None:
    """Draw one cycle: for each tray the images after shaking and at the end, and the sizes.

    Parameters
    ----------
    path : Path
    clusters : BagClusters
    pixels_per_metre : float
        Scale of the tray images.

    Raises
    ------
    RecordingError
        If the file cannot be written.

    References
    ----------
    After [B19] fig. 8.
    """
    with figure_file(path, TWO_COLUMNS, _HEIGHT * len(clusters.trays)) as figure:
        parts = figure.subfigures(len(clusters.trays), 1, squeeze=False)[:, 0]
        for part, (number, tray) in zip(parts, clusters.trays.items(), strict=True):
            left, right = part.subfigures(1, 2, width_ratios=(11, 9))
            pairs = left.subplots(2, 2, squeeze=False)
            ends = tray.snapshots[0], tray.snapshots[-1]
            for row, snapshot in zip(pairs, ends, strict=True):
                _draw_snapshot(row, snapshot, pixels_per_metre)
            _draw_sizes(right.subplots(), tray)
            part.suptitle(f'tray {number}, cycle {clusters.cycle}', x=0.01, ha='left')


def _draw_snapshot(row: NDArray[np.object_], snapshot: Snapshot, scale: float) -> None:
    height, width = snapshot.gray.shape
    half = 0.5 * _MM * width / scale, 0.5 * _MM * height / scale
    row[0].imshow(snapshot.gray, cmap='gray', extent=(0, 2 * half[0], 2 * half[1], 0))
    row[0].set_title(f'{snapshot.since:.1f} s after shaking')
    row[0].set_xlabel('x [mm]')
    row[0].set_ylabel('y [mm]')
    rows, columns = snapshot.values.shape
    step = 2 * half[0] / columns, 2 * half[1] / rows
    x = (np.arange(columns) - columns // 2) * step[0]
    y = (np.arange(rows) - rows // 2) * step[1]
    row[1].contour(x, y, snapshot.values, levels=_LEVELS, cmap=MAP, linewidths=0.9)
    row[1].contour(x, y, snapshot.values, levels=[0.5], colors=[VERMILION], linewidths=1.6)
    row[1].set_aspect('equal')
    reach = min(*half, 5.0)
    row[1].set_xlim(-reach, reach)
    row[1].set_ylim(reach, -reach)
    row[1].set_title('autocorrelation')
    row[1].set_xlabel('shift in x [mm]')
    row[1].set_ylabel('shift in y [mm]')


def _draw_sizes(axes: Axes, tray: CycleClusters) -> None:
    times = tray.times
    size, lower, upper = (
        tray.column(name) for name in ('cluster_size', 'cluster_size_lower', 'cluster_size_upper')
    )
    if len(tray.truth):
        axes.plot(*tray.truth[:, :2].T, color=TRUTH, lw=3.5, alpha=0.7, label='true')
    finite = np.isfinite(lower).tolist()
    axes.fill_between(times, lower, upper, where=finite, color=MEASURED, alpha=0.2, lw=0)
    label = 'measured, band of 68 %'
    axes.plot(times, size, '.-', ms=3, lw=0.8, color=MEASURED, label=label)
    paper = tray.paper_sizes()
    label = f"paper's line, {tray.counted():.0f} beads at the end"
    axes.plot(times, paper, color=VERMILION, lw=1.0, ls='--', label=label)
    for onset, colour, text in (
        (tray.paper_onset(), VERMILION, "paper's onset"),
        (tray.true_onset(), TRUTH, 'first beads stick'),
    ):
        if math.isfinite(onset):
            axes.axvline(onset, color=colour, lw=1.2, ls=':', label=f'{text}: {onset:.1f} s')
    shown = np.concatenate([size, paper, tray.truth[:, 1]])
    # Room for the legend.
    axes.set_ylim(0.8, 12.0 * max(np.nanmax(shown, initial=1.0), 3.0))
    axes.set_yscale('log')
    plain_numbers(axes.yaxis)
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('cluster size, mean over beads [beads]')
    # The lines of the onsets end below the words.
    axes.legend(loc='upper left', frameon=True, framealpha=1.0, edgecolor='none')
    axes.grid(alpha=0.25, which='major')
