"""Figure of the speeds of one cycle by every method, with the ground truth if it is known.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import BLACK, BLUE, GREEN, TRUTH, TWO_COLUMNS, VERMILION
from nanorocks_ros.records import NS
from nanorocks_ros.studies.inspection.speed_comparison import AUTO, METHODS

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from nanorocks_ros.records import SpeedEstimate
    from nanorocks_ros.studies.inspection.speed_comparison import BagSpeeds, ComparedSpeeds

_MM = 1e3
_COLOURS = {
    'tracking': GREEN,
    'structure_function': BLUE,
    'binarised_area': VERMILION,
}
_HEIGHT = 58.0
# Upper limit of the speed axis, as a multiple of the largest true speed, or of the largest speed
# by tracking and structure function.
_HEADROOM = 1.6
# Range of the axis of estimate / truth, and tolerance of the shaded band.
_RATIOS, _TOLERANCE = (0.4, 10.0), 0.1


def speeds_figure(path: Path, bag_speeds: BagSpeeds, cycle: int) -> None:
    """Draw the speeds of one cycle by every method, one row per tray.

    Bands are one standard error as stated by the method; dots are the speeds selected from the
    data. If the truth is known, a second column shows estimate / truth.

    Parameters
    ----------
    path : Path
    bag_speeds : BagSpeeds
    cycle : int
        One of `ComparedSpeeds.cycles`; times count from its shaking event, those of cycle 0
        from the epoch.

    Raises
    ------
    RecordingError
        If the file cannot be written.

    References
    ----------
    After [B19] fig. 2.
    """
    has_truth = any(tray.truth for tray in bag_speeds.trays.values())
    with figure_file(path, TWO_COLUMNS, _HEIGHT * len(bag_speeds.trays) + 8.0) as figure:
        columns: dict[str, Any] = {'width_ratios': (3, 2)} if has_truth else {}
        rows = figure.subplots(
            len(bag_speeds.trays), 1 + has_truth, squeeze=False, sharex=True, **columns
        )
        for row, (number, tray) in zip(rows, bag_speeds.trays.items(), strict=True):
            start_ns = _start_ns(bag_speeds, cycle)
            _draw_speeds(row[0], tray, cycle, start_ns)
            row[0].set_title(f'tray {number}, cycle {cycle}')
            if has_truth:
                _draw_ratios(row[1], tray, cycle, start_ns)
        since = 'since the shaking event' if cycle else 'since the beginning'
        for axes in rows[-1]:
            axes.set_xlabel(f'time {since} [s]')
        lines, names = rows[0, 0].get_legend_handles_labels()
        figure.legend(lines, names, loc='outside upper left', ncols=len(names))


def _start_ns(bag_speeds: BagSpeeds, cycle: int) -> int:
    starts = [
        speed.cycle_start_ns
        for tray in bag_speeds.trays.values()
        for speeds in tray.speeds.values()
        for speed in speeds
        if speed.cycle == cycle and speed.cycle_start_ns is not None
    ]
    return min(starts, default=bag_speeds.epoch_ns)


def _in_cycle(tray: ComparedSpeeds, method: str, cycle: int) -> list[SpeedEstimate]:
    return [speed for speed in tray.speeds[method] if speed.cycle == cycle]


def _draw_speeds(axes: Axes, tray: ComparedSpeeds, cycle: int, start_ns: int) -> None:
    shown = [0.0]
    truth = [record for record in tray.truth if record.cycle == cycle]
    if truth:
        values = [_MM * record.mean_projected_speed for record in truth]
        times = [(record.stamp_ns - start_ns) / NS for record in truth]
        axes.plot(times, values, color=TRUTH, lw=4, alpha=0.6, label='truth')
        shown += values
    for method in METHODS:
        estimates = _in_cycle(tray, method, cycle)
        times = [(estimate.stamp_ns - start_ns) / NS for estimate in estimates]
        speed = _MM * np.array([estimate.mean_projected_speed.value for estimate in estimates])
        error = _MM * np.array([estimate.mean_projected_speed.error for estimate in estimates])
        colour = _COLOURS[method]
        axes.fill_between(times, speed - error, speed + error, color=colour, alpha=0.2, lw=0)
        axes.plot(times, speed, color=colour, lw=1.2, label=method.replace('_', ' '))
        if not truth and method != 'binarised_area':
            shown += speed[np.isfinite(speed)].tolist()
    chosen = _in_cycle(tray, AUTO, cycle)
    axes.plot(
        [(estimate.stamp_ns - start_ns) / NS for estimate in chosen],
        [_MM * estimate.mean_projected_speed.value for estimate in chosen],
        '.',
        ms=3.5,
        color=BLACK,
        label='chosen from the data',
    )
    if max(shown) > 0.0:
        axes.set_ylim(0.0, _HEADROOM * max(shown))
    axes.set_ylabel('mean projected speed [mm/s]')
    axes.grid(alpha=0.25)


def _draw_ratios(axes: Axes, tray: ComparedSpeeds, cycle: int, start_ns: int) -> None:
    axes.axhspan(1.0 - _TOLERANCE, 1.0 + _TOLERANCE, color=TRUTH, alpha=0.25, lw=0)
    for method in METHODS:
        estimates = _in_cycle(tray, method, cycle)
        true = tray.true_speeds(estimates)
        times = [(estimate.stamp_ns - start_ns) / NS for estimate in estimates]
        speeds = np.array([estimate.mean_projected_speed.value for estimate in estimates])
        with np.errstate(divide='ignore', invalid='ignore'):
            axes.plot(times, speeds / true, color=_COLOURS[method], lw=1.2)
    axes.set_yscale('log')
    axes.set_ylim(*_RATIOS)
    axes.set_yticks([0.5, 0.8, 1.0, 1.25, 2.0, 3.0, 5.0, 10.0])
    axes.yaxis.set_major_formatter('{x:g}')
    axes.yaxis.set_minor_locator(mpl.ticker.NullLocator())
    axes.set_ylabel('estimate / truth')
    axes.set_title(f'grey: within {100 * _TOLERANCE:.0f} %')
    axes.grid(alpha=0.25)
