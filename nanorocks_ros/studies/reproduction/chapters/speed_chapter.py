"""Chapter on the speeds of the beads: Figures 2, 5 and 6.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.paper_values import PAPER_PEAK_SPEED
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import (
    GREEN,
    MEASURED,
    PAPER,
    TRUTH,
    TWO_COLUMNS,
    plain_numbers,
)
from nanorocks_ros.outputs.html_report import Erratum, Picture, Section, Table
from nanorocks_ros.studies.inspection.speed_comparison import compare_speeds
from nanorocks_ros.studies.inspection.speeds_figure import speeds_figure
from nanorocks_ros.studies.reproduction.campaign_plan import plate_settings
from nanorocks_ros.studies.reproduction.chapters.chapter_context import (
    Chapter,
    Difference,
    mean_text,
)
from nanorocks_ros.studies.reproduction.figures.area_figure import area_figure
from nanorocks_ros.studies.reproduction.marked_calibration import (
    area_series,
    calibrated,
    marked_fit,
)

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.inspection.speed_comparison import ComparedSpeeds
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_MM = 1e3
_SHOWN = (('tracking', MEASURED, 'o'), ('structure_function', GREEN, 's'),
          ('binarised_area', PAPER, '^'))  # fmt: skip
_NAMES = {
    'tracking': 'tracking',
    'structure_function': 'structure function',
    'binarised_area': "the paper's binarised area",
}
# Time after the shaking event in which the peak is searched, [s].
_PEAK_WINDOW = 3.0
_SOURCES = 'default', 'paper', 'truth'
_DRAWN = 'default', 'calibrated', 'truth'
_COLUMNS = 'paper', 'calibrated', 'default', 'truth'


def speed_chapter(context: Context) -> Chapter:
    """Figures 2, 5 and 6."""
    section = Section(title='Speeds (Figures 2, 5 and 6)')
    settings = plate_settings(trays=[1])
    speeds = compare_speeds(context.film(), settings, progress=context.count)
    tray_speeds = speeds.trays[1]
    cycle = speeds.first_cycle()
    over_time, ratios = context.picture('speeds.png'), context.picture('speed_ratios.png')
    area = context.picture('area.png')
    area_figure(area, context.bouncing[0])
    speeds_figure(over_time, speeds, cycle)
    _draw_ratios(ratios, tray_speeds, cycle)
    section.parts += [
        Picture(path=over_time, caption='Figure 2: speed in tray 1 by each method over one cycle, '
                'with the truth in place of the manual tracks; the area is not calibrated.'),
        Picture(path=area, caption='Figure 5: a) a disc that moves by dx uncovers and covers the '
                'striped area, which the paper takes to be 4 R dx; it saturates at 2 π R². b) The '
                'speed of tray 3 over a cycle by that area, before and after the calibration by '
                'ten marked beads of each kind.'),
        Picture(path=ratios, caption='Ratio of measured to true speed of tray 1 against the true '
                'speed, the area not calibrated. The ratio of an unbiased method is 1.'),
        Erratum(
            text='The area that changes between two images measures the speed only while noise, '
            'shading and threshold do not change with the speed. The paper corrects it by the '
            'mean speed of ten marked beads of each kind in one cycle; so does this report, with '
            'a factor and an offset for each tray (marked beads are the true ones, without errors '
            'of a hand). The paper gives neither threshold nor despeckling, and its difference of '
            'averages of ten frames has a time step of 1/3 s, not the 0.033 s it writes; 1/3 s is '
            'used here. `nanorocks calibrate-area` does the same with marks of your own.'
        ),
    ]  # fmt: skip
    rows, differences = [], []
    peaks: dict[int, tuple[float, ...]] = {}
    for tray, properties in load_trays().items():
        values = {
            source: [_peak(cycle, tray, source) for cycle in context.cycles] for source in _SOURCES
        }
        values['calibrated'] = _calibrated_peaks(context, properties)
        peaks[tray] = tuple(mean_of(values[source])[0] for source in _DRAWN)
        reported = f'{_MM * PAPER_PEAK_SPEED:g}' if tray == 1 else ''
        cells = {source: mean_text(values[source], _MM) for source in values}
        rows.append((str(tray), reported, *(cells[source] for source in _COLUMNS)))
        if tray == 1:
            by_method = cells['calibrated'], cells['default'], cells['truth']
            differences.append(Difference('peak speed, tray 1 [mm/s]', reported, *by_method))
            findings = [
                'The peak speed of tray 1 comes out as {} mm/s by the calibrated area and {} mm/s '
                'by our tracks, where {} mm/s is true.'.format(*by_method)
            ]
    path = context.picture('peaks.png')
    _draw_peaks(path, peaks)
    section.parts += [
        Picture(path=path, caption='Figure 6: the highest mean projected speed after a '
                'shaking event, by tray. The values of the paper are in its figure alone, but '
                'for tray 1.'),
        Table(
            head=('tray', 'the paper', 'area, not calibrated', 'area, calibrated', 'ours',
                  'truth'),
            rows=rows,
            caption='Peak mean projected speed within '
            f'{_PEAK_WINDOW:g} s after a shaking event [mm/s]; mean of the cycles and its '
            'standard error (none for a single cycle). Every method takes the highest of many '
            'noisy values and so reads high. A dash: the area does not follow the marked beads. '
            'All trays start alike here; how fast they were in flight is known for tray 1 alone: '
            f'here {_MM * context.plan.mean_speed:.1f} mm/s in three dimensions.',
        ),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences, findings=findings)


def _calibrated_peaks(context: Context, tray: Tray) -> list[float]:
    """Highest calibrated speeds by the area, [m/s]; none where it cannot be calibrated."""
    try:
        fit = marked_fit(context.bouncing[0], tray)
    except FitError as error:
        context.notice(f'speeds: {error}')
        return []
    series = [calibrated(area_series(cycle, tray.number), fit) for cycle in context.cycles]
    early = [speeds.speed[speeds.times < _PEAK_WINDOW] for speeds in series]
    return [float(speeds.max()) for speeds in early if speeds.size]


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
    with figure_file(path, TWO_COLUMNS, 100.0) as figure:
        axes = figure.subplots()
        for method, colour, marker in _SHOWN:
            speeds = [speed for speed in tray_speeds.speeds[method] if speed.cycle == cycle]
            if not speeds:
                continue
            true = tray_speeds.true_speeds(speeds)
            ratio = np.array([speed.mean_projected_speed.value for speed in speeds]) / true
            axes.plot(
                _MM * true, ratio, marker, color=colour, ms=3, alpha=0.6, label=_NAMES[method]
            )
        axes.axhline(1.0, color='0.5', lw=1)
        axes.set(xscale='log', yscale='log', xlabel='true mean projected speed [mm/s]',
                 ylabel='measured / true')  # fmt: skip
        for axis in (axes.xaxis, axes.yaxis):
            plain_numbers(axis)
        axes.grid(alpha=0.25)
        axes.legend()


def _draw_peaks(path: Path, peaks: dict[int, tuple[float, ...]]) -> None:
    with figure_file(path, TWO_COLUMNS, 90.0) as figure:
        axes: Any = figure.subplots()
        trays = np.array(list(peaks))
        values = _MM * np.array(list(peaks.values()), dtype=np.float64)
        for column, (name, colour, marker, shift) in enumerate(
            (('ours', MEASURED, 'o', -0.12), ("the paper's area, calibrated", PAPER, '^', 0.12),
             ('truth', TRUTH, '_', 0.0))
        ):  # fmt: skip
            size = 16 if marker == '_' else 6
            axes.plot(trays + shift, values[:, column], marker, color=colour, ms=size, label=name)
        axes.plot([1], [_MM * PAPER_PEAK_SPEED], 'k*', ms=9, label='the paper, tray 1')
        axes.set(xlabel='tray', ylabel='peak speed [mm/s]', ylim=(0.0, None))
        axes.grid(alpha=0.25)
        axes.legend()
