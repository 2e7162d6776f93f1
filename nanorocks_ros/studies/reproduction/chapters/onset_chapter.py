"""Chapter on the onset of clustering and the sticking speed: Figure 14.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.html_report import (
    Erratum,
    Picture,
    Section,
    Table,
    with_interval,
)
from nanorocks_ros.physics.dust_models import PAPER_STICKING_SPEEDS, collapse_time_factor
from nanorocks_ros.physics.paper_clusters import paper_onset
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.figures.dust_figure import (
    dust_figure,
    paper_thresholds,
    threshold_of_tray,
)
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE
from nanorocks_ros.studies.reproduction.chapters.chapter_context import (
    Chapter,
    Difference,
    mean_text,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_MM = 1e3
_TRAYS = (1, 3, 5)
_COLUMNS = ('time', 'cycle', 'level_area', 'combined_size', 'cluster_size', 'weighted_size')


def onset_chapter(context: Context) -> Chapter:
    """Onset of clustering and sticking speed; figure 14."""
    section = Section(title='Onset of sticking (Figure 14)')
    rows, differences, points, findings = [], [], [], []
    trays = load_trays()
    for tray in _TRAYS:
        onset = mean_text([cycle.first_cycle(tray).get('onset') for cycle in context.sticking])
        true_onset = mean_text([_true_onset(cycle, tray) for cycle in context.sticking])
        paper, thresholds = _paper_onsets(context.sticking, tray)
        control, control_thresholds = _paper_onsets(context.bouncing, tray)
        threshold = mean_text(thresholds, _MM)
        false_onsets = [cycle.first_cycle(tray).get('onset') for cycle in context.bouncing]
        alarms = sum(onset is not None for onset in false_onsets)
        speed, lower, upper = _sticking_speed(context, tray)
        ours = with_interval(speed, (lower, upper), _MM)
        rows.append(
            (
                str(tray), mean_text(paper), mean_text(control), onset,
                f'{alarms} of {len(false_onsets)}', true_onset,
                f'{_MM * PAPER_STICKING_SPEEDS[tray]:g}', threshold,
                mean_text(control_thresholds, _MM), ours,
            )
        )  # fmt: skip
        differences.append(
            Difference(
                f'sticking speed, tray {tray} [mm/s]',
                f'{_MM * PAPER_STICKING_SPEEDS[tray]:g}',
                threshold,
                ours,
                f'{_MM * context.plan.sticking_speed:g}',
            )
        )
        if tray == _TRAYS[0]:
            findings.append(
                f'The rule of the paper finds an onset of clustering in {len(control)} of '
                f'{len(context.bouncing)} cycles of tray {tray} in which nothing sticks.'
            )
        if not math.isnan(speed):
            points.append(threshold_of_tray(trays[tray], speed, (lower, upper), 'simulated films'))
    path = context.picture('dust.png')
    dust_figure(path, [*points, *paper_thresholds(trays)])
    section.parts += [
        Table(
            head=('tray', "paper's rule: onset [s]", 'the same, nothing sticks', 'ours [s]',
                  'ours, nothing sticks', 'truth [s]', 'the paper: speed [mm/s]',
                  "paper's rule here", 'the same, nothing sticks', 'ours [95 %]'),
            rows=rows,
            caption='Onset of sticking after the shaking event, and sticking speed; mean of the '
            'cycles ± its standard error (none for a single cycle), in brackets the mean ends of '
            'the intervals of single cycles. The paper compares whole relative speeds; the true '
            'sticking speed is '
            f'{_MM * context.plan.sticking_speed:g} mm/s along the line of centres.',
        ),
        Erratum(
            text='Its onset is where the derivative of the cluster size becomes positive. '
            'Any fluctuation meets this rule at once: it finds an onset without sticking as well '
            '(third column), and twice the mean speed at that time is no threshold.'
        ),
        Picture(
            path=path,
            caption='Figure 14: sticking thresholds against mass, beside published dust collision '
            'models; those whose constants could not be traced are marked as unverified.',
        ),
        'Collapse of a cloud of such particles takes longer by a factor (1 − restitution²)⁻¹: '
        f'{collapse_time_factor(0.89):.2f} for 0.89, "up to a factor 5" in the paper.',
    ]  # fmt: skip
    return Chapter(section=section, differences=differences, findings=findings)


def _true_onset(cycle: CycleFiles, tray: int) -> float:
    """First loss of a body since the shaking event, [s]."""
    truth = cycle.tray(tray)['truth']
    bodies = np.array(truth['bodies'])
    losses = np.flatnonzero(bodies < bodies[0])
    return float(truth['time'][losses[0]]) - FIRST_SHAKE if losses.size else math.nan


def _cluster_table(cycle: CycleFiles, tray: int) -> dict[str, NDArray[np.float64]]:
    return read_columns(cycle.results / f'tray_{tray}_cluster.csv', _COLUMNS)


def _paper_onsets(cycles: list[CycleFiles], tray: int) -> tuple[list[float], list[float]]:
    """Onsets by the paper's rule, [s], and twice the mean speeds then, [m/s]."""
    onsets, speeds = [], []
    for cycle in cycles:
        table = _cluster_table(cycle, tray)
        onset = paper_onset(table['time'], table['level_area'], FIRST_SHAKE)
        if math.isnan(onset):
            continue
        onsets.append(onset - FIRST_SHAKE)
        results = cycle.tray(tray)
        speeds.append(
            2.0 * float(np.interp(onset, results['time'], results['mean_projected_speed']))
        )
    return onsets, speeds


def _sticking_speed(context: Context, tray: int) -> tuple[float, float, float]:
    """Sticking speed and ends of its interval, [m/s]; means over the cycles that have one."""
    ends = [cycle.first_cycle(tray) for cycle in context.sticking]
    names = ('sticking_speed', 'sticking_speed_lower', 'sticking_speed_upper')
    known_ends = [end for end in ends if end.get('sticking_speed') is not None]
    speed, lower, upper = (
        mean_of([end.get(name) for end in known_ends or ends])[0] for name in names
    )
    return speed, lower, upper
