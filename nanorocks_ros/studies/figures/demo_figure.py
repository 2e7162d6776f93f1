"""The figure of the demo: one cooling cycle and its restitution."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, TRUTH, TWO_COLUMNS, plain_numbers
from nanorocks_ros.physics.haff_law import granular_energy, haff_speed
from nanorocks_ros.records import NS, CorRelation, CorStatus
from nanorocks_ros.studies.analysis.results.published_cycles import Truth, published_lines

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import CorEstimate, GroundTruth, SpeedEstimate

_MM = 1e3
_COMMAND = 'make demo'
_NANOJOULE = 1e9


def cooling_figure(
    path: Path,
    tray: Tray,
    speeds: Sequence[SpeedEstimate],
    cors: Sequence[CorEstimate],
    truth: Sequence[GroundTruth] = (),
) -> None:
    """Draw the decay of one cycle, its fit, and the convergence of the restitution, as a PNG.

    Parameters
    ----------
    path : Path
    tray : Tray
    speeds, cors, truth : sequences of records
        Of one cycle, in order of time; `cors` must not be empty.

    References
    ----------
    Upper panel after [B19] fig. 7.
    """
    with figure_file(path, TWO_COLUMNS, 150.0, _COMMAND) as figure:
        energy, convergence = figure.subplots(2, 1, height_ratios=(3, 2), sharex=True)
        start_ns = next(
            speed.cycle_start_ns for speed in speeds if speed.cycle_start_ns is not None
        )
        _draw_energy(energy, tray, (speeds, cors, truth), start_ns)
        _draw_convergence(convergence, cors, truth, start_ns)


def _draw_energy(
    axes: Axes,
    tray: Tray,
    records: tuple[Sequence[SpeedEstimate], Sequence[CorEstimate], Sequence[GroundTruth]],
    start_ns: int,
) -> None:
    speeds, cors, truth = records
    mass = tray.mean_mass

    def energy(values: Sequence[float]) -> list[float]:
        return [granular_energy(v, mass) * _NANOJOULE for v in values]

    if truth:
        axes.plot(
            [(state.stamp_ns - start_ns) / NS for state in truth],
            energy([state.mean_projected_speed for state in truth]),
            color=TRUTH,
            lw=3,
            alpha=0.6,
            label='truth (simulator)',
        )
    time = np.array([(speed.stamp_ns - start_ns) / NS for speed in speeds])
    axes.plot(
        time,
        energy([speed.mean_projected_speed.value for speed in speeds]),
        'o',
        ms=3.5,
        color=MEASURED,
        label='from the frames',
    )
    last = cors[-1]
    if math.isfinite(last.haff_time.value):
        start = last.cooling_start if math.isfinite(last.cooling_start) else 0.0
        line = np.linspace(start, max(time), 300)
        fitted = haff_speed(line - start, last.initial_speed.value, last.haff_time.value)
        axes.plot(
            line,
            energy(list(fitted)),
            color=FITTED,
            lw=1.8,
            label=f"Haff's law, $v_0$ = {last.initial_speed.value * _MM:.2f} mm/s, "
            rf'$\tau$ = {last.haff_time.value:.2f} s',
        )
    axes.set_yscale('log')
    plain_numbers(axes.yaxis)
    axes.set_ylabel(r'energy per bead $\frac{1}{2} m \bar{v}^2$ [nJ]')
    title = f'Tray {tray.number}, cycle {last.cycle}: cooling after the shaking event'
    known = Truth(truth[-1].restitution, truth[-1].wall_restitution) if truth else None
    axes.set_title('\n'.join([title, *published_lines([last], known)]), fontsize=7.5)
    axes.legend()
    axes.grid(alpha=0.25)


def _draw_convergence(
    axes: Axes, cors: Sequence[CorEstimate], truth: Sequence[GroundTruth], start_ns: int
) -> None:
    known = [cor for cor in cors if cor.status is not CorStatus.NO_DECAY]
    by_paper = bool(cors) and cors[-1].relation is CorRelation.PAPER
    time = [(estimate.stamp_ns - start_ns) / NS for estimate in known]
    axes.fill_between(
        time,
        [estimate.restitution.lower for estimate in known],
        [estimate.restitution.upper for estimate in known],
        color=FITTED,
        alpha=0.2,
        lw=0,
        label='interval (statistics only)' if by_paper else 'interval of 95 %',
    )
    axes.plot(
        time,
        [estimate.restitution.value for estimate in known],
        '-o',
        ms=3,
        color=FITTED,
        label=_name(known[-1], by_paper) if known else None,
    )
    if truth:
        axes.axhline(
            truth[-1].restitution,
            color=TRUTH,
            lw=2,
            ls='--',
            label=f'truth: {truth[-1].restitution:g}',
        )
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('coefficient of restitution')
    if not by_paper:
        axes.plot(
            time,
            [estimate.paper_restitution for estimate in known],
            ':',
            lw=1.2,
            color=MEASURED,
            label='closed form of the paper',
        )
    axes.set_ylim(top=1.005)
    axes.legend(loc='lower right')
    axes.grid(alpha=0.25)


def _name(last: CorEstimate, by_paper: bool) -> str:
    source = 'closed form of the paper' if by_paper else 'published'
    return f'{source}: {last.restitution.value:.3f}'
