"""The picture of simulated runs: beads at a few times, and the decay of their speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from nanorocks_ros.outputs.atomic_files import whole_file
from nanorocks_ros.studies.synthetic.simulated_plan import shown_times

mpl.use('Agg')
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRun, SimulatedRuns

_MM = 1e3
_RUN, _MEAN, _MARK = '#8fa8bf', '#c23b22', '#30506f'
_COLOURS = 'viridis'
# Trays that are longer than this, for their width, are shown two by two.
_LONG = 1.8
# Speeds are coloured over so many powers of ten.
_DECADES = 2
# Size of the figure, and of its lower panel, [in].
_WIDTH, _BELOW = 10.0, 3.6
_FLOOR = '#e9ecef'


def simulated_figure(path: Path, found: SimulatedRuns) -> None:
    """Draw the beads of the first run from above, coloured by speed, and the decay of all runs.

    Parameters
    ----------
    path : Path
    found : SimulatedRuns
        Of a plan that keeps the first run at `shown_times`, or the trajectory.

    Raises
    ------
    RecordingError
        When the picture cannot be written.

    References
    ----------
    Lower panel after [B19] fig. 11.
    """
    shown = shown_times(found.plan.samples)
    length, width, _ = found.plan.tray.dimensions
    columns = min(len(shown), 2 if length > _LONG * width else len(shown))
    rows = -(-len(shown) // columns)
    above = rows * (_WIDTH / columns * width / length + 0.4)
    figure = Figure(figsize=(_WIDTH, above + _BELOW), layout='constrained')
    panels: Any = figure.subfigures(2, 1, height_ratios=(above, _BELOW))
    trays = panels[0].subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    _draw_trays(trays, found, shown)
    _draw_decay(panels[1].subplots(), found, shown)
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)


def _draw_trays(trays: NDArray[np.object_], found: SimulatedRuns, shown: tuple[int, ...]) -> None:
    plan, run = found.plan, found.runs[0]
    kept = list(plan.bead_times(0))
    speeds = np.linalg.norm(run.velocities, axis=2) * _MM
    most = float(speeds.max()) or 1.0
    norm = LogNorm(vmin=most / 10**_DECADES, vmax=most, clip=True)
    for axes, k in zip(trays.ravel(), shown, strict=False):
        place = kept.index(k)
        axes.add_collection(_beads(axes, run, place, speeds[place], norm))
        axes.set_title(f't = {plan.times[k]:.3g} s', fontsize=10)
        axes.set_aspect('equal')
        axes.set_facecolor(_FLOOR)
        axes.set_xlim(0.0, plan.tray.dimensions[0] * _MM)
        # As the camera sees it: y points down.
        axes.set_ylim(plan.tray.dimensions[1] * _MM, 0.0)
    for axes in trays.ravel()[len(shown) :]:
        axes.set_axis_off()
    for axes in trays[-1]:
        axes.set_xlabel('x [mm]')
    for axes in trays[:, 0]:
        axes.set_ylabel('y [mm]')
    bar = trays[0, 0].figure.colorbar(
        ScalarMappable(norm=norm, cmap=_COLOURS), ax=trays, extend='min', pad=0.01
    )
    bar.set_label('speed [mm/s]')
    _label_in_full(bar.ax)


def _beads(
    axes: Axes, run: SimulatedRun, place: int, speeds: NDArray[np.float64], norm: LogNorm
) -> EllipseCollection:
    """The beads at one time, those nearer to the camera on top."""
    order = np.argsort(run.positions[place, :, 2])
    across = 2.0 * run.radii[order] * _MM
    beads = EllipseCollection(
        across,
        across,
        np.zeros(order.size),
        units='xy',
        offsets=run.positions[place, order, :2] * _MM,
        offset_transform=axes.transData,
        cmap=_COLOURS,
        norm=norm,
        edgecolors='white',
        linewidths=0.4,
    )
    beads.set_array(speeds[order])
    return beads


def _draw_decay(axes: Axes, found: SimulatedRuns, shown: tuple[int, ...]) -> None:
    times, mean = found.plan.times, found.mean('mean_speed') * _MM
    n = len(found.runs)
    if n > 1:
        curves = [np.column_stack((times, run.mean_speed * _MM)) for run in found.runs]
        # Thousands of thin lines are a band; as vectors they would be megabytes.
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
        found.runs[0].mean_speed[list(shown)] * _MM,
        'o',
        ms=5,
        color=_MARK,
        clip_on=False,
        label='the run shown above' if n > 1 else 'as shown above',
    )
    axes.set_xlim(0.0, found.plan.duration)
    if mean.min() > 0.0:
        axes.set_yscale('log')
        _label_in_full(axes)
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('mean speed of the beads [mm/s]')
    settings = found.plan.settings
    axes.set_title(
        f'Tray {settings.tray}: {found.plan.tray.count} beads, restitution '
        f'{settings.restitution:g}, walls {settings.wall_restitution:g}, seed {settings.seed}',
        fontsize=10,
    )
    handles: Any = axes.legend(frameon=False).legend_handles
    for handle in handles:
        handle.set_alpha(1.0)
    axes.grid(alpha=0.25)


def _label_in_full(axes: Axes) -> None:
    """Numbers along a logarithmic axis as people write them: 0.5, 1, 2."""
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter('{x:g}')
    axes.yaxis.set_minor_formatter(NullFormatter())
