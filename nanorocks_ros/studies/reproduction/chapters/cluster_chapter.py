"""Chapters on clusters, their packing and long-term evolution: Table 3, Figures 8 to 10.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.experiment.paper_values import PAPER_CLUSTER_PEAK
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import MAP, TWO_COLUMNS, scale_bar
from nanorocks_ros.outputs.html_report import (
    NOT_KNOWN,
    Erratum,
    Picture,
    Section,
    Table,
    with_error,
)
from nanorocks_ros.physics.paper_clusters import PAPER_TABLE_3
from nanorocks_ros.stages.clusters.correlation_width import correlated
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.analysis.cluster_packing import measured_packing
from nanorocks_ros.studies.analysis.long_term import read_campaign
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.figures.long_term_figure import long_term_figure
from nanorocks_ros.studies.figures.packing_figure import packing_figure
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE, STICKING, plate_settings
from nanorocks_ros.studies.reproduction.chapters.chapter_context import (
    Chapter,
    Difference,
    mean_text,
)
from nanorocks_ros.studies.reproduction.figures.growth_figure import growth_figure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_MM = 1e3
_TRAYS = (1, 3, 5)
_SHOWN = 3
# A count this long before the end of a cycle is none of its end, [s]: under chalk tracks are lost.
_AT_END = 5.0
_COUNTS = (
    'clusters', 'clustered_share', 'weighted_size', 'clusters_error', 'clustered_share_error'
)  # fmt: skip


def cluster_chapter(context: Context) -> Chapter:
    """Table 3 and figure 8."""
    section = Section(title='Clusters (Table 3, Figure 8)')
    path = context.picture('autocorrelation.png')
    _draw_autocorrelation(context, path)
    growth = context.picture('growth.png')
    growth_figure(growth, context.sticking, _SHOWN)
    counts, sizes, differences, findings = [], [], [], []
    for number, tray in load_trays().items():
        truth = [_true_end(cycle, tray) for cycle in context.sticking]
        ours = [tracked_end(cycle, tray) for cycle in context.sticking]
        paper = PAPER_TABLE_3[number]
        by_hand = (
            f'{paper.clusters:.2f}',
            f'{paper.beads_per_cluster:.2f} ± {paper.deviation:.2f}',
            f'{100.0 * paper.share:.1f}',
        )
        counts += [
            (str(number), *by_hand, 'truth', *table_3_cells(truth)),
            ('', '', '', '', 'ours', *table_3_cells(ours)),
        ]
        ends = [cycle.first_cycle(number) for cycle in context.sticking]
        size = _with_own_error(
            [end.get('cluster_size') for end in ends],
            [end.get('cluster_size_error') for end in ends],
        )
        true_size = mean_text([end.weighted_size for end in truth])
        sizes.append((str(number), size, true_size))
        if number in _TRAYS:
            shares = [table_3_cells(end)[2] for end in (ours, truth)]
            quantity = f'beads in clusters at the end, tray {number} [%]'
            differences.append(Difference(quantity, by_hand[2], '', *shares))
            quantity = f'cluster size at the end, weight-averaged, tray {number} [beads]'
            differences.append(Difference(quantity, '', '', size, true_size))
        if number == _SHOWN:
            findings.append(
                f'In tray {_SHOWN}, {shares[0]} % of the beads are in clusters at the end of the '
                f'cycles with sticking by our tracks, where {shares[1]} % is true.'
            )
    section.parts += [
        Picture(
            path=path,
            caption='Figure 8a to d: tray 3 just after shaking and at the end of a cycle with '
            'sticking, with the autocorrelation of both images and contours at 0.3, 0.5 and 0.7 '
            '(the levels of the paper are not given).',
        ),
        Picture(
            path=growth,
            caption='Figure 8e: cluster size of tray 3 over a cycle with sticking and its '
            'derivative: by the rule of the paper, proportional to the area within a level of '
            'the autocorrelation with the factor that makes its end the true number of beads '
            'per cluster; by our calibration together with tracks; and the truth, averaged over '
            'clusters (as the paper counts) and over beads (as ours). The paper finds a largest '
            f'size of {PAPER_CLUSTER_PEAK:g} in its cycle, and 10 at the end.',
        ),
        Table(
            head=('tray', 'the paper: clusters', 'beads in each', 'beads in clusters [%]',
                  'here', 'clusters', 'beads in each', 'beads in clusters [%]'),
            rows=counts,
            caption='Table 3: at the end of cycles in which beads stick below '
            f'{_MM * context.plan.sticking_speed:g} mm/s, counted as in the paper: two or more '
            'beads that stick are a cluster, single beads are none. Mean over the cycles; '
            'clusters and shares ± standard error, by the scatter of the cycles or the errors of '
            'our counts, whichever is larger; beads in each ± mean absolute deviation of the '
            'cycles as in the paper. '
            'A dash: counted in fewer than half of the cycles, since chalk hides beads or grains '
            'are too many. The counts of the flight need not agree with these: its sticking '
            'speed is unknown, and simulated clusters do not break, so that nearly all beads end '
            'in one cluster, where the paper counted several. '
            'In tray 4 the paper divides by the beads that the glare of the LEDs leaves visible: '
            'its 85.6 % are 64.2 % of all beads.',
        ),
        Table(
            head=('tray', 'ours', 'truth'),
            rows=sizes,
            caption='Beads in the cluster of a bead, averaged over all beads (single ones count '
            'as 1), at the end of the same cycles: autocorrelation and tracks together. '
            'A dash: beyond the calibration, or not sensitive to the size.',
        ),
        Erratum(
            text='A linear calibration of the autocorrelation fails: its area stops growing long '
            'before the clusters do. Our calibration is a curve from simulated clusters with a '
            'known end, and tracks count bodies directly.'
        ),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences, findings=findings)


class ClusterEnd(NamedTuple):
    """Clusters at the end of a cycle; NaN where unknown, errors 0 for the truth."""

    clusters: float
    beads_per_cluster: float
    share: float
    weighted_size: float
    clusters_error: float = 0.0
    share_error: float = 0.0


def _true_end(cycle: CycleFiles, tray: Tray) -> ClusterEnd:
    truth = cycle.summary['truth'][str(tray.number)]
    clusters, beads = truth['clusters'][-1], truth['beads_in_clusters'][-1]
    mean = beads / clusters if clusters else math.nan
    return ClusterEnd(clusters, mean, beads / tray.count, truth['weighted_size'][-1])


def tracked_end(cycle: CycleFiles, tray: Tray) -> ClusterEnd:
    """Clusters at the end of a cycle by tracks; unknown where these were lost before it.

    Parameters
    ----------
    cycle : CycleFiles
    tray : Tray
    """
    path = cycle.results / f'tray_{tray.number}_bodies.csv'
    if not path.is_file():
        return ClusterEnd(*4 * (math.nan,))
    columns = read_columns(path, ('time', *_COUNTS))
    end = cycle.summary['truth'][str(tray.number)]['time'][-1]
    if not (columns['time'].size and columns['time'][-1] > end - _AT_END):
        return ClusterEnd(*4 * (math.nan,))
    clusters, share, size, clusters_error, share_error = (
        float(columns[name][-1]) for name in _COUNTS
    )
    mean = share * tray.count / clusters if clusters > 0.0 else math.nan
    return ClusterEnd(clusters, mean, share, size, clusters_error, share_error)


def table_3_cells(ends: Sequence[ClusterEnd]) -> tuple[str, str, str]:
    """Clusters, beads in each, and share of the beads in clusters, [%].

    Parameters
    ----------
    ends : sequence of ClusterEnd
        Of the cycles of a tray. Where fewer than half of them are known nothing is.
    """
    each = np.array([end.beads_per_cluster for end in ends])
    each = each[np.isfinite(each)]
    if 2 * sum(math.isfinite(end.clusters) for end in ends) < len(ends):
        # The few cycles in which tracks are left are not like the others.
        return NOT_KNOWN, NOT_KNOWN, NOT_KNOWN
    deviation = float(np.abs(each - each.mean()).mean()) if each.size > 1 else math.nan
    return (
        _with_own_error([end.clusters for end in ends], [end.clusters_error for end in ends]),
        with_error(float(each.mean()), deviation) if each.size else NOT_KNOWN,
        _with_own_error([end.share for end in ends], [end.share_error for end in ends], 100.0),
    )


def _with_own_error(
    values: Sequence[float | None], errors: Sequence[float | None], factor: float = 1.0
) -> str:
    """Mean over the cycles, and its error by their scatter or by those of the measurements."""
    mean, scatter, count = mean_of(values)
    return with_error(
        mean, float(np.fmax(scatter, mean_of(errors)[0])) / math.sqrt(max(count, 1)), factor
    )


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
                'the compaction by the rule of the paper; its filling factors are in its figure '
                'alone.'),
        _compactions(values),
        Erratum(
            text='The height of a cluster of one layer is the diameter of a bead, not its radius: '
            'the filling factors of its Figure 10 are too large by a factor of 2. A hexagonal '
            'layer has a filling factor of at most 0.605, so agreement with random close '
            'packing, 0.64, is no evidence. `nanorocks figure packing --simulate` adds the true '
            'filling factor.'
        ),
    ]  # fmt: skip
    return Chapter(section=section)


def _compactions(trays: dict[str, Any]) -> Table:
    rows = []
    for tray, values in trays.items():
        apparent, error = (
            math.nan if values[name] is None else values[name]
            for name in ('apparent_compaction', 'apparent_compaction_error')
        )
        reported = f'{100.0 * values["paper_compaction"]:.1f}'
        rows.append((tray, reported, with_error(apparent, error, 100.0)))
    return Table(
        head=('tray', 'the paper [%]', 'its rule, on our films [%]'),
        rows=rows,
        caption='Compaction from the widest autocorrelation to the end of the cycle. Simulated '
        'clusters are rigid: their true compaction is 0. The rule uses the maximum of a noisy '
        'curve, and so finds a compaction in any data.',
    )


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
    with figure_file(path, TWO_COLUMNS, 120.0) as figure:
        axes: Any = figure.subplots(2, 2)
        names = ('0.5 s after the shaking event', 'at the end of the cycle')
        for row, (gray, name) in enumerate(zip((early, late), names, strict=True)):
            if gray is None:
                continue
            axes[row, 0].imshow(gray, cmap='gray')
            scale_bar(axes[row, 0], scale / _MM)
            axes[row, 0].set_title(name)
            correlation = correlated(gray, scale)
            half = min(correlation.values.shape) // 4
            middle = [size // 2 for size in correlation.values.shape]
            near = correlation.values[
                middle[0] - half : middle[0] + half, middle[1] - half : middle[1] + half
            ]
            side = _MM * correlation.side * half
            extent = (-side, side, side, -side)
            axes[row, 1].imshow(near, cmap=MAP, vmin=0.0, vmax=1.0, extent=extent)
            axes[row, 1].contour(near, levels=(0.3, 0.5, 0.7), colors='w', linewidths=1,
                                 extent=(-side, side, -side, side))  # fmt: skip
            axes[row, 1].set(title='autocorrelation', ylabel='shift in y [mm]')
            axes[row, 0].set_axis_off()
        axes[1, 1].set_xlabel('shift in x [mm]')
