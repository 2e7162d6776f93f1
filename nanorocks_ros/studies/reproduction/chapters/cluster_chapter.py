"""Clusters, onset of sticking, packing, long-term evolution: Table 3, figures 8 to 10, 14."""

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
        true = [_end(one.summary['clusters'][str(tray)]) for one in context.sticking]
        ours = [_last(one, tray) for one in context.sticking]
        weighted = mean_of([one['weighted_size'] for one in true])[0]
        sizes = [one.get('cluster_size') for one in ours]
        size = mean_of(sizes)[0]
        bodies = mean_of([one.get('bodies') for one in ours])[0]
        rows.append(
            (
                str(tray),
                f'{paper.clusters:g}',
                f'{paper.beads_per_cluster:g} ± {paper.deviation:g}',
                number(mean_of([one['clusters'] for one in true])[0]),
                number(bodies),
                number(mean_of([one['bodies'] for one in true])[0]),
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
            caption='Figure 8: tray 3 just after shaking and at the end of a cycle in which beads '
            'stick, and the autocorrelation of both, with contours at 0.3, 0.5 and 0.7.',
        ),
        Table(
            head=('tray', 'the paper: clusters', 'beads each', 'true clusters here',
                  'bodies, ours', 'bodies, truth', 'size, ours', 'size, truth'),
            rows=rows,
            caption='Table 3: at the end of cycles in which beads stick below '
            f'{_MM * context.plan.sticking_speed:g} mm/s. Sizes are averaged over the beads. The '
            'paper counted clusters of flight by hand, of beads whose sticking speed is not '
            'known: its numbers stand beside ours, and need not agree with them.',
        ),
        Erratum(
            text='A linear calibration of the autocorrelation fails: its area stops growing long '
            'before the clusters do. Ours is a curve from simulated clusters that says where it '
            'ends, and tracks count bodies directly.'
        ),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences)


def onset_chapter(context: Context) -> Chapter:
    """Onset of clustering and sticking speed; figure 14."""
    section = Section(title='Onset of sticking (Figure 14)')
    rows, differences, points = [], [], []
    trays = load_trays()
    for tray in _TRAYS:
        onset = mean_of([_last(one, tray).get('onset') for one in context.sticking])[0]
        true = mean_of([_true_onset(one, tray) for one in context.sticking])[0]
        paper, threshold = _paper_onsets(context.sticking, tray)
        control, control_threshold = _paper_onsets(context.bouncing, tray)
        false = [_last(one, tray).get('onset') for one in context.bouncing]
        alarms = sum(one is not None for one in false)
        speed, lower, upper = _sticking(context, tray)
        found = '–' if math.isnan(speed) else number(speed, 3, _MM)
        rows.append(
            (
                str(tray), number(paper), number(control), number(onset),
                f'{alarms} of {len(false)}', number(true),
                f'{_MM * PAPER_STICKING_SPEEDS[tray]:g}', number(threshold, 3, _MM),
                number(control_threshold, 3, _MM),
                f'{found} [{number(lower, 3, _MM)}, {number(upper, 3, _MM)}]',
            )
        )  # fmt: skip
        differences.append(
            Difference(
                f'sticking speed, tray {tray} [mm/s]',
                f'{_MM * PAPER_STICKING_SPEEDS[tray]:g}',
                number(threshold, 3, _MM),
                f'{found} [{number(lower, 3, _MM)}, {number(upper, 3, _MM)}]',
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
            caption='When beads begin to stick, and below which speed; the truth is '
            f'{_MM * context.plan.sticking_speed:g} mm/s along the line of centres.',
        ),
        Erratum(
            text='Its onset is where the derivative of the cluster size becomes positive. '
            'Whatever fluctuates does that at once: the rule fires where nothing sticks at all '
            '(third column), and twice the mean speed at that instant is no threshold.'
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
        tray: [curve for one in context.sticking for curve in measured_packing(one.results, tray)]
        for tray in _TRAYS
    }
    packing = context.picture('packing.png')
    found = packing_figure(packing, {tray: trays[tray] for tray in _TRAYS}, curves)
    section.parts += [
        Picture(
            path=long_term,
            caption='Figure 9: cycles of this campaign in order, without and with sticking in '
            'turn. No wear or change of the beads is simulated, so any trend is chance.',
        ),
        Picture(path=packing, caption='Figure 10: level areas over the cycles in which beads '
                'stick, and the compaction that the paper would read from them.'),
        _compactions(found),
        Erratum(
            text='The height of a cluster of one layer is the diameter of a bead, not its radius: '
            'the printed filling factors are twice what they are. A hexagonal layer fills 0.605 '
            'of the space at most, so that agreement with random close packing, 0.64, shows '
            'nothing. `nanorocks figure packing --simulate` shows the true filling beside it.'
        ),
    ]  # fmt: skip
    return Chapter(section=section)


def _compactions(found: dict[str, Any]) -> Table:
    rows = [
        (
            tray,
            number(values.get('paper_compaction'), 2, 100.0),
            number(values.get('apparent_compaction'), 2, 100.0),
        )
        for tray, values in found.items()
    ]
    return Table(
        head=('tray', 'the paper [%]', 'its rule, on our films [%]'),
        rows=rows,
        caption='Compaction from the widest autocorrelation to the end of the cycle. Simulated '
        'clusters are rigid: in truth there is none. The rule takes the maximum of a curve that '
        'scatters, and finds some wherever it looks.',
    )


def _last(one: CycleFiles, tray: int) -> dict[str, Any]:
    """What our analysis says of the clusters of a tray at the end of its first cycle."""
    cycles = one.tray(tray)['cycles']
    return dict(cycles[0]) if cycles else {}


def _end(truth: dict[str, list[float]]) -> dict[str, float]:
    return {name: values[-1] for name, values in truth.items()}


def _true_onset(one: CycleFiles, tray: int) -> float:
    """First loss of a body since the shaking event, [s]."""
    truth = one.tray(tray)['truth']
    bodies = np.array(truth['bodies'])
    fallen = np.flatnonzero(bodies < bodies[0])
    return float(truth['time'][fallen[0]]) - FIRST_SHAKE if fallen.size else math.nan


def _table(one: CycleFiles, tray: int) -> dict[str, NDArray[np.float64]]:
    return read_columns(one.results / f'tray_{tray}_cluster.csv', _COLUMNS)


def _paper_onsets(cycles: list[CycleFiles], tray: int) -> tuple[float, float]:
    """Onset by the paper's rule, [s], and twice the mean speed then, [m/s]; means of cycles."""
    onsets, speeds = [], []
    for cycle in cycles:
        table = _table(cycle, tray)
        at = paper_onset(table['time'], table['level_area'], FIRST_SHAKE)
        if math.isnan(at):
            continue
        onsets.append(at - FIRST_SHAKE)
        found = cycle.tray(tray)
        speeds.append(2.0 * float(np.interp(at, found['time'], found['mean_projected_speed'])))
    return mean_of(onsets)[0], mean_of(speeds)[0]


def _sticking(context: Context, tray: int) -> tuple[float, float, float]:
    """Sticking speed and ends of its interval, [m/s]; means of the cycles that tell one."""
    last = [_last(one, tray) for one in context.sticking]
    names = ('sticking_speed', 'sticking_speed_lower', 'sticking_speed_upper')
    known = [one for one in last if one.get('sticking_speed') is not None]
    speed, lower, upper = (mean_of([one.get(name) for one in known or last])[0] for name in names)
    return speed, lower, upper


def _draw_autocorrelation(context: Context, path: Path) -> None:
    """A tray soon after shaking and at the end, with the autocorrelation of both."""
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
        seen = correlated(gray, scale)
        half = min(seen.values.shape) // 4
        middle = [size // 2 for size in seen.values.shape]
        near = seen.values[
            middle[0] - half : middle[0] + half, middle[1] - half : middle[1] + half
        ]
        side = _MM * seen.side * half
        extent = (-side, side, side, -side)
        axes[row, 1].imshow(near, cmap='viridis', vmin=0.0, vmax=1.0, extent=extent)
        axes[row, 1].contour(near, levels=(0.3, 0.5, 0.7), colors='w', linewidths=1,
                             extent=(-side, side, -side, side))  # fmt: skip
        axes[row, 1].set_title('autocorrelation; shifts in mm', fontsize=10)
        axes[row, 0].set_axis_off()
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)
