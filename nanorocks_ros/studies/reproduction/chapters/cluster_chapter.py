"""Chapters on clusters, their packing and long-term evolution: Table 3, Figures 8 to 10.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.html_report import Erratum, Picture, Section, Table, number
from nanorocks_ros.physics.paper_clusters import PAPER_TABLE_3
from nanorocks_ros.stages.clusters.correlation_width import correlated
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.analysis.cluster_packing import measured_packing
from nanorocks_ros.studies.analysis.long_term import read_campaign
from nanorocks_ros.studies.figures.long_term_figure import long_term_figure
from nanorocks_ros.studies.figures.packing_figure import packing_figure
from nanorocks_ros.studies.reproduction.campaign_plan import FIRST_SHAKE, STICKING, plate_settings
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter, Difference

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_MM = 1e3
_TRAYS = (1, 3, 5)
_SHOWN = 3


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
        our_ends = [cycle.first_cycle(tray) for cycle in context.sticking]
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


def _last_values(truth: dict[str, list[float]]) -> dict[str, float]:
    return {name: values[-1] for name, values in truth.items()}


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
    with atomic_file(path) as part:
        figure.savefig(part, dpi=110)
