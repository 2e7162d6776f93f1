"""Chapter on the speeds of the beads: Figures 2, 5 and 6.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from nanorocks_ros.experiment.paper_values import PAPER_PEAK_SPEED
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.html_report import Erratum, Picture, Section, Table, number
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.inspection.speed_comparison import compare_speeds
from nanorocks_ros.studies.inspection.speeds_figure import speeds_figure
from nanorocks_ros.studies.reproduction.campaign_plan import plate_settings
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter, Difference

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.studies.inspection.speed_comparison import ComparedSpeeds
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_MM = 1e3
_SHOWN = (('tracking', '#30506f', 'o'), ('structure_function', '#2a9d8f', 's'),
          ('binarised_area', '#c23b22', '^'))  # fmt: skip
_NAMES = {
    'tracking': 'tracking',
    'structure_function': 'structure function',
    'binarised_area': "the paper's binarised area",
}
# Time after the shaking event in which the peak is searched, [s].
_PEAK_WINDOW = 3.0
_SOURCES = 'default', 'paper', 'truth'


def speed_chapter(context: Context) -> Chapter:
    """Figures 2, 5 and 6."""
    section = Section(title='Speeds (Figures 2, 5 and 6)')
    settings = plate_settings(trays=[1])
    speeds = compare_speeds(context.film(), settings, progress=context.count)
    tray_speeds = speeds.trays[1]
    cycle = speeds.first_cycle()
    over_time, ratios = context.picture('speeds.png'), context.picture('speed_ratios.png')
    speeds_figure(over_time, speeds, cycle)
    _draw_ratios(ratios, tray_speeds, cycle)
    section.parts += [
        Picture(path=over_time, caption='Figure 2: speed in tray 1 by each method over one cycle, '
                'with the truth.'),
        Picture(path=ratios, caption='Result of Figure 5: ratio of measured to true speed '
                'against the true speed. The ratio of an unbiased method is 1.'),
        Erratum(
            text='The area that changes between two images measures the speed only while noise, '
            'shading and threshold do not change with the speed; its factor has to be found by '
            'hand for each tray and speed. The paper leaves open the sign of the difference, the '
            'averaging and the threshold, and possible readings of it differ from each other by '
            'more than from the truth.'
        ),
    ]  # fmt: skip
    rows, differences = [], []
    peaks: dict[int, tuple[float, float, float]] = {}
    for tray in load_trays():
        ours, paper, truth = (
            mean_of([_peak(film, tray, source) for film in context.cycles])[0]
            for source in _SOURCES
        )
        peaks[tray] = ours, paper, truth
        reported = f'{_MM * PAPER_PEAK_SPEED:g}' if tray == 1 else ''
        cells = [number(value, 3, _MM) for value in (paper, ours, truth)]
        rows.append((str(tray), reported, *cells))
        if tray == 1:
            differences.append(Difference('peak speed, tray 1 [mm/s]', reported, *cells))
    path = context.picture('peaks.png')
    _draw_peaks(path, peaks)
    section.parts += [
        Picture(path=path, caption='Figure 6: the highest mean projected speed after a '
                'shaking event, by tray.'),
        Table(
            head=('tray', 'the paper', 'its method here', 'ours', 'truth'),
            rows=rows,
            caption='Peak mean projected speed after a shaking event [mm/s], mean of the cycles. '
            'The strength of the shaking in flight is unknown: here it gives the beads a mean '
            f'speed of {_MM * SimulationSettings().mean_speed:g} mm/s in three dimensions.',
        ),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences)


def _peak(cycle: CycleFiles, tray: int, source: str) -> float:
    """The highest speed soon after the shaking event, [m/s]; NaN where unknown."""
    truth = cycle.tray(tray)['truth']
    true_time = np.array(truth['time'])
    true_speed = np.array(truth['mean_projected_speed'], dtype=np.float64)
    start = float(true_time[int(np.argmax(np.diff(true_speed))) + 1])
    if source == 'truth':
        time, speed = true_time, true_speed
    else:
        results = cycle.tray(tray, source)
        time = np.array(results['time'])
        speed = np.array(results['mean_projected_speed'], dtype=np.float64)
    near = (time >= start) & (time < start + _PEAK_WINDOW) & np.isfinite(speed)
    return float(speed[near].max()) if near.any() else math.nan


def _draw_ratios(path: Path, tray_speeds: ComparedSpeeds, cycle: int) -> None:
    figure = Figure(figsize=(8.0, 4.5), layout='constrained')
    axes = figure.subplots()
    for method, colour, marker in _SHOWN:
        speeds = [speed for speed in tray_speeds.speeds[method] if speed.cycle == cycle]
        if not speeds:
            continue
        true = tray_speeds.true_speeds(speeds)
        ratio = np.array([speed.mean_projected_speed.value for speed in speeds]) / true
        axes.plot(_MM * true, ratio, marker, color=colour, ms=3, alpha=0.6, label=_NAMES[method])
    axes.axhline(1.0, color='0.5', lw=1)
    axes.set(xscale='log', yscale='log', xlabel='true mean projected speed [mm/s]',
             ylabel='measured / true')  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter('{x:g}')
        axis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    with atomic_file(path) as part:
        figure.savefig(part, dpi=110)


def _draw_peaks(path: Path, peaks: dict[int, tuple[float, float, float]]) -> None:
    figure = Figure(figsize=(8.0, 4.0), layout='constrained')
    axes: Any = figure.subplots()
    trays = np.array(list(peaks))
    values = _MM * np.array(list(peaks.values()), dtype=np.float64)
    for column, (name, colour, marker, shift) in enumerate(
        (('ours', '#30506f', 'o', -0.12), ("the paper's method", '#c23b22', '^', 0.12),
         ('truth', '0.4', '_', 0.0))
    ):  # fmt: skip
        size = 16 if marker == '_' else 6
        axes.plot(trays + shift, values[:, column], marker, color=colour, ms=size, label=name)
    axes.plot([1], [_MM * PAPER_PEAK_SPEED], 'k*', ms=9, label='the paper, tray 1')
    axes.set(xlabel='tray', ylabel='peak speed [mm/s]', ylim=(0.0, None))
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    with atomic_file(path) as part:
        figure.savefig(part, dpi=110)
