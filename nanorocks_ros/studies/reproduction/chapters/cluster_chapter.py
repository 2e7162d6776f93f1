"""Chapters on clusters, onset, packing and long-term evolution: Table 3, Figures 8 to 10, 14."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.atomic_files import whole_file
from nanorocks_ros.outputs.html_report import Erratum, Picture, Section, Table, number
from nanorocks_ros.physics.dust_models import PAPER_STICKING_SPEEDS, collapse_time_factor
from nanorocks_ros.physics.paper_clusters import PAPER_TABLE_3, paper_onset
from nanorocks_ros.stages.clusters.correlation_width import correlated
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.analysis.cluster_packing import measured_packing
from nanorocks_ros.studies.analysis.long_term import read_campaign
from nanorocks_ros.studies.analysis.result_tables import read_columns
from nanorocks_ros.studies.figures.dust_figure import (
    dust_figure,
    paper_thresholds,
    threshold_of_tray,
)
from nanorocks_ros.studies.figures.long_term_figure import long_term_figure
from nanorocks_ros.studies.figures.packing_figure import packing_figure
from nanorocks_ros.studies.reproduction.campaign_plan import (
    FIRST_SHAKE,
    STICKING,
    plate_settings,
)
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter, Difference

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_MM = 1e3
_TRAYS = (1, 3, 5)
_SHOWN = 3
_COLUMNS = ('time', 'cycle', 'level_area', 'combined_size', 'cluster_size', 'weighted_size')


def cluster_chapter(context: Context) -> Chapter:
    """Table 3 and figure 8."""
    section = Section(title='Clusters (Table 3, Figure 8)')
    path = context.picture('autocorrelation.png')
    _draw_autocorrelation(context, path)
    rows, differences = [], []
    for tray in load_trays():
        paper = PAPER_TABLE_3[tray]
        true_ends = [
            _last_values(cycle.summary['clusters'][str(tray)]) for cycle in context.sticking
        ]
        our_ends = [_first_cycle(cycle, tray) for cycle in context.sticking]
        weighted = mean_of([end['weighted_size'] for end in true_ends])[0]
        sizes = [end.get('cluster_size') for end in our_ends]
        size = mean_of(sizes)[0]
        bodies = mean_of([end.get('bodies') for end in our_ends])[0]
        rows.append(
            (
                str(tray),
                f'{paper.clusters:g}',
                f'{paper.beads_per_cluster:g} ± {paper.deviation:g}',
                number(mean_of([end['clusters'] for end in true_ends])[0]),
                number(bodies),
                number(mean_of([end['bodies'] for end in true_ends])[0]),
                number(size),
                number(weighted),
            )
        )
        if tray in _TRAYS:
            differences.append(
                Difference(
                    f'cluster size at the end, weight-averaged, tray {tray} [beads]',
                    '',
                    '',
                    number(size),
                    number(weighted),
                )
            )
    section.parts += [
        Picture(
            path=path,
            caption='Figure 8: tray 3 just after shaking and at the end of a cycle with sticking, '
            'with the autocorrelation of both images and contours at 0.3, 0.5 and 0.7.',
        ),
        Table(
            head=('tray', 'the paper: clusters', 'beads each', 'true clusters here',
                  'bodies, ours', 'bodies, truth', 'size, ours', 'size, truth'),
            rows=rows,
            caption='Table 3: at the end of cycles in which beads stick below '
            f'{_MM * context.plan.sticking_speed:g} mm/s. Sizes are averaged over the beads. The '
            'paper counted clusters in flight by hand. The sticking speed of its beads is '
            'unknown, so its numbers need not agree with ours.',
        ),
        Erratum(
            text='A linear calibration of the autocorrelation fails: its area stops growing long '
            'before the clusters do. Our calibration is a curve from simulated clusters with a '
            'known end, and tracks count bodies directly.'
        ),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences)


def onset_chapter(context: Context) -> Chapter:
    """Onset of clustering and sticking speed; figure 14."""
    section = Section(title='Onset of sticking (Figure 14)')
    rows, differences, points = [], [], []
    trays = load_trays()
    for tray in _TRAYS:
        onset = mean_of([_first_cycle(cycle, tray).get('onset') for cycle in context.sticking])[0]
        true_onset = mean_of([_true_onset(cycle, tray) for cycle in context.sticking])[0]
        paper, threshold = _paper_onsets(context.sticking, tray)
        control, control_threshold = _paper_onsets(context.bouncing, tray)
        false_onsets = [_first_cycle(cycle, tray).get('onset') for cycle in context.bouncing]
        alarms = sum(onset is not None for onset in false_onsets)
        speed, lower, upper = _sticking_speed(context, tray)
        speed_text = '–' if math.isnan(speed) else number(speed, 3, _MM)
        rows.append(
            (
                str(tray), number(paper), number(control), number(onset),
                f'{alarms} of {len(false_onsets)}', number(true_onset),
                f'{_MM * PAPER_STICKING_SPEEDS[tray]:g}', number(threshold, 3, _MM),
                number(control_threshold, 3, _MM),
                f'{speed_text} [{number(lower, 3, _MM)}, {number(upper, 3, _MM)}]',
            )
        )  # fmt: skip
        differences.append(
            Difference(
                f'sticking speed, tray {tray} [mm/s]',
                f'{_MM * PAPER_STICKING_SPEEDS[tray]:g}',
                number(threshold, 3, _MM),
                f'{speed_text} [{number(lower, 3, _MM)}, {number(upper, 3, _MM)}]',
                f'{_MM * context.plan.sticking_speed:g}',
            )
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
            caption='Onset of sticking, and sticking speed; the true sticking speed is '
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
        f'{collapse_time_factor(0.89):.2f} for 0.89, as the paper says.',
    ]  # fmt: skip
    return Chapter(section=section, differences=differences)


def packing_chapter(context: Context) -> Chapter:
    """Figures 9 and 10."""
    section = Section(title='Long-term evolution and packing (Figures 9 and 10)')
    trays = load_trays()
    long_term = context.picture('long_term.png')
    long_term_figure(long_term, read_campaign([cycle.results for cycle in context.cycles]))
    curves = {
        tray: [
            curve for cycle in context.sticking for curve in measured_packing(cycle.results, tray)
        ]
        for tray in _TRAYS
    }
    packing = context.picture('packing.png')
    values = packing_figure(packing, {tray: trays[tray] for tray in _TRAYS}, curves)
    section.parts += [
        Picture(
            path=long_term,
            caption='Figure 9: cycles of this campaign in order, without and with sticking in '
            'turn. The simulation has no wear of the beads, so any trend is due to chance.',
        ),
        Picture(path=packing, caption='Figure 10: level areas over the cycles with sticking, and '
                'the compaction by the rule of the paper.'),
        _compactions(values),
        Erratum(
            text='The height of a cluster of one layer is the diameter of a bead, not its radius: '
            'the printed filling factors are too large by a factor of 2. A hexagonal layer has a '
            'filling factor of at most 0.605, so agreement with random close packing, 0.64, is '
            'no evidence. `nanorocks figure packing --simulate` adds the true filling factor.'
        ),
    ]  # fmt: skip
    return Chapter(section=section)


def _compactions(trays: dict[str, Any]) -> Table:
    rows = [
        (
            tray,
            number(values.get('paper_compaction'), 2, 100.0),
            number(values.get('apparent_compaction'), 2, 100.0),
        )
        for tray, values in trays.items()
    ]
    return Table(
        head=('tray', 'the paper [%]', 'its rule, on our films [%]'),
        rows=rows,
        caption='Compaction from the widest autocorrelation to the end of the cycle. Simulated '
        'clusters are rigid: their true compaction is 0. The rule uses the maximum of a noisy '
        'curve, and so finds a compaction in any data.',
    )


def _first_cycle(cycle: CycleFiles, tray: int) -> dict[str, Any]:
    """The summary of the first cycle of a tray by our analysis."""
    cycles = cycle.tray(tray)['cycles']
    return dict(cycles[0]) if cycles else {}


def _last_values(truth: dict[str, list[float]]) -> dict[str, float]:
    return {name: values[-1] for name, values in truth.items()}


def _true_onset(cycle: CycleFiles, tray: int) -> float:
    """First loss of a body since the shaking event, [s]."""
    truth = cycle.tray(tray)['truth']
    bodies = np.array(truth['bodies'])
    losses = np.flatnonzero(bodies < bodies[0])
    return float(truth['time'][losses[0]]) - FIRST_SHAKE if losses.size else math.nan


def _cluster_table(cycle: CycleFiles, tray: int) -> dict[str, NDArray[np.float64]]:
    return read_columns(cycle.results / f'tray_{tray}_cluster.csv', _COLUMNS)


def _paper_onsets(cycles: list[CycleFiles], tray: int) -> tuple[float, float]:
    """Mean onset by the paper's rule, [s], and mean of twice the mean speed then, [m/s]."""
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
    return mean_of(onsets)[0], mean_of(speeds)[0]


def _sticking_speed(context: Context, tray: int) -> tuple[float, float, float]:
    """Sticking speed and ends of its interval, [m/s]; means over the cycles that have one."""
    ends = [_first_cycle(cycle, tray) for cycle in context.sticking]
    names = ('sticking_speed', 'sticking_speed_lower', 'sticking_speed_upper')
    known_ends = [end for end in ends if end.get('sticking_speed') is not None]
    speed, lower, upper = (
        mean_of([end.get(name) for end in known_ends or ends])[0] for name in names
    )
    return speed, lower, upper


def _draw_autocorrelation(context: Context, path: Path) -> None:
    """Draw a tray soon after shaking and at the end, with the autocorrelation of both images."""
    settings = plate_settings(trays=[_SHOWN])
    images = BagImages(context.film(STICKING), settings, '')
    scale = settings.preprocess.pixels_per_metre
    early, late = None, None
    for shot in images.shots(context.count):
        for image in shot.images:
            age = (image.stamp_ns - images.epoch_ns) / 1e9 - FIRST_SHAKE
            if early is None and age > 0.5:
                early = image.gray
            late = image.gray
    figure = Figure(figsize=(9.0, 6.2), layout='constrained')
    axes: Any = figure.subplots(2, 2)
    names = ('0.5 s after the shaking event', 'at the end of the cycle')
    for row, (gray, name) in enumerate(zip((early, late), names, strict=True)):
        if gray is None:
            continue
        axes[row, 0].imshow(gray, cmap='gray')
        axes[row, 0].set_title(name, fontsize=10)
        correlation = correlated(gray, scale)
        half = min(correlation.values.shape) // 4
        middle = [size // 2 for size in correlation.values.shape]
        near = correlation.values[
            middle[0] - half : middle[0] + half, middle[1] - half : middle[1] + half
        ]
        side = _MM * correlation.side * half
        extent = (-side, side, side, -side)
        axes[row, 1].imshow(near, cmap='viridis', vmin=0.0, vmax=1.0, extent=extent)
        axes[row, 1].contour(near, levels=(0.3, 0.5, 0.7), colors='w', linewidths=1,
                             extent=(-side, side, -side, side))  # fmt: skip
        axes[row, 1].set_title('autocorrelation; shifts in mm', fontsize=10)
        axes[row, 0].set_axis_off()
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)
