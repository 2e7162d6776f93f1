"""Figure of simulated runs: beads at a few times, and the decay of their speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LogNorm

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import BLACK, FITTED, MAP, SKY, TWO_COLUMNS, plain_numbers
from nanorocks_ros.studies.synthetic.simulated_plan import shown_times

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRun, SimulatedRuns

_MM = 1e3
_RUN, _MEAN, _MARK = SKY, FITTED, BLACK
# Trays of a larger ratio of length to width are drawn in two columns.
_LONG_ASPECT = 1.8
# Powers of ten in the colour scale of speeds.
_DECADES = 2
# Height of the lower panel, [mm], and of the labels of a tray.
_DECAY_HEIGHT = 72.0
_FLOOR = '#e9ecef'


def simulated_figure(path: Path | None, simulated: SimulatedRuns) -> Figure:
    """Draw the beads of the first run from above, coloured by speed, and the decay of all runs.

    Parameters
    ----------
    path : Path or None
        None: the figure is not written.
    simulated : SimulatedRuns
        Of a plan that keeps the first run at `shown_times`, or the trajectory.

    Raises
    ------
    RecordingError
        When the picture cannot be written.

    References
    ----------
    Lower panel after [B19] fig. 11.
    """
    shown_indices = shown_times(simulated.plan.samples)
    length, width, _ = simulated.plan.tray.dimensions
    columns = min(len(shown_indices), 2 if length > _LONG_ASPECT * width else len(shown_indices))
    rows = -(-len(shown_indices) // columns)
    trays_height = rows * (TWO_COLUMNS / columns * width / length + 10.0)
    with figure_file(path, TWO_COLUMNS, trays_height + _DECAY_HEIGHT) as figure:
        panels: Any = figure.subfigures(2, 1, height_ratios=(trays_height, _DECAY_HEIGHT))
        trays = panels[0].subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        _draw_trays(trays, simulated, shown_indices)
        _draw_decay(panels[1].subplots(), simulated, shown_indices)
    return figure


def _draw_trays(
    trays: NDArray[np.object_], simulated: SimulatedRuns, shown: tuple[int, ...]
) -> None:
    plan, run = simulated.plan, simulated.runs[0]
    kept = list(plan.bead_times(0))
    speeds = np.linalg.norm(run.velocities, axis=2) * _MM
    max_speed = float(speeds.max()) or 1.0
    norm = LogNorm(vmin=max_speed / 10**_DECADES, vmax=max_speed, clip=True)
    for axes, k in zip(trays.ravel(), shown, strict=False):
        index = kept.index(k)
        axes.add_collection(_beads(axes, run, index, speeds[index], norm))
        axes.set_title(f't = {plan.times[k]:.3g} s')
        axes.set_aspect('equal')
        axes.set_facecolor(_FLOOR)
        axes.set_xlim(0.0, plan.tray.dimensions[0] * _MM)
        # As in the camera image: y points down.
        axes.set_ylim(plan.tray.dimensions[1] * _MM, 0.0)
    for axes in trays.ravel()[len(shown) :]:
        axes.set_axis_off()
    for axes in trays[-1]:
        axes.set_xlabel('x [mm]')
    for axes in trays[:, 0]:
        axes.set_ylabel('y [mm]')
    bar = trays[0, 0].figure.colorbar(
        ScalarMappable(norm=norm, cmap=MAP), ax=trays, extend='min', pad=0.01
    )
    bar.set_label('speed [mm/s]')
    plain_numbers(bar.ax.yaxis)


def _beads(
    axes: Axes, run: SimulatedRun, index: int, speeds: NDArray[np.float64], norm: LogNorm
) -> EllipseCollection:
    """The beads at one time, with those nearer to the camera on top."""
    order = np.argsort(run.positions[index, :, 2])
    diameters = 2.0 * run.radii[order] * _MM
    beads = EllipseCollection(
        diameters,
        diameters,
        np.zeros(order.size),
        units='xy',
        offsets=run.positions[index, order, :2] * _MM,
        offset_transform=axes.transData,
        cmap=MAP,
        norm=norm,
        edgecolors='white',
        linewidths=0.4,
    )
    beads.set_array(speeds[order])
    return beads


def _draw_decay(axes: Axes, simulated: SimulatedRuns, shown: tuple[int, ...]) -> None:
    times, mean = simulated.plan.times, simulated.mean('mean_speed') * _MM
    n = len(simulated.runs)
    if n > 1:
        curves = [np.column_stack((times, run.mean_speed * _MM)) for run in simulated.runs]
        # Rasterised: thousands of lines would be megabytes as vectors.
        axes.add_collection(
            LineCollection(
                curves,
                colors=_RUN,
                linewidths=0.8,
                alpha=max(0.1, min(0.7, 16.0 / n)),
                rasterized=True,
                label=f'{n} runs',
            )
        )
    axes.plot(times, mean, color=_MEAN, lw=2, label='their mean' if n > 1 else None)
    axes.plot(
        times[list(shown)],
        simulated.runs[0].mean_speed[list(shown)] * _MM,
        'o',
        ms=5,
        color=_MARK,
        clip_on=False,
        label='the run shown above' if n > 1 else 'as shown above',
    )
    axes.set_xlim(0.0, simulated.plan.duration)
    if mean.min() > 0.0:
        axes.set_yscale('log')
        plain_numbers(axes.yaxis)
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('mean speed of the beads [mm/s]')
    settings = simulated.plan.settings
    axes.set_title(
        f'Tray {settings.tray}: {simulated.plan.tray.count} beads, restitution '
        f'{settings.restitution:g}, walls {settings.wall_restitution:g}, seed {settings.seed}',
    )
    handles: Any = axes.legend().legend_handles
    for handle in handles:
        handle.set_alpha(1.0)
    axes.grid(alpha=0.25)
