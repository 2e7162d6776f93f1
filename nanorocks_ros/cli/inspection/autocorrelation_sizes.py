"""``nanorocks autocorrelation BAG``: cluster sizes from the width of the autocorrelation.

Tested by ``test/studies/inspection/test_autocorrelations.py``.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.outputs.json_values import json_values

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.inspection.autocorrelations import BagClusters, CycleClusters


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser(
        'autocorrelation', help='cluster sizes by autocorrelation over a cycle, as in figure 8'
    )
    add_bag(parser)
    parser.add_argument('-o', '--output', help='picture to write: .png, .pdf or .svg')
    parser.add_argument('--table', help='table of all images to write, .csv')
    parser.add_argument(
        '--cycle',
        type=int,
        default=1,
        help='cycle to measure, counted in shaking events; default 1',
    )
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure cluster sizes, write and print them, and return the exit code."""
    from nanorocks_ros.cli.flags import bag_settings
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.inspection.autocorrelations import cycle_clusters, write_clusters

    names = {'--output': options.output, '--table': options.table}
    files = {flag: Path(name) for flag, name in names.items() if name}
    kinds = {'--output': ('.png', '.pdf', '.svg'), '--table': ('.csv',)}
    check_outputs(files, kinds, force=options.force)
    settings, assumed, _ = bag_settings(options, options.bag)
    with interruption_says('nothing was written'), Progress('measuring') as progress:
        clusters = cycle_clusters(
            Path(options.bag),
            settings,
            cycle=options.cycle,
            image_topic=options.image_topic,
            progress=progress.count,
        )
    print_notices((*assumed, *clusters.notices), options)
    if '--table' in files:
        write_clusters(files['--table'], clusters)
    if '--output' in files:
        from nanorocks_ros.studies.inspection.autocorrelation_figure import autocorrelation_figure

        autocorrelation_figure(files['--output'], clusters, settings.preprocess.pixels_per_metre)
    for flag, path in files.items():
        print(f'nanorocks: {flag[2:]} in {path}', file=sys.stderr)
    _print(clusters, as_json=options.json)
    return 0


def _print(clusters: BagClusters, *, as_json: bool) -> None:
    ends = {number: _last_estimate(tray) for number, tray in clusters.trays.items()}
    if as_json:
        trays = {str(number): json_values(end) for number, end in ends.items()}
        print(json.dumps({'cycle': clusters.cycle, 'trays': trays}, allow_nan=False))
        return
    for number, end in ends.items():
        size = end['cluster_size']
        lower, upper = end['cluster_size_lower'], end['cluster_size_upper']
        size_text = f'{size:.1f} beads ({lower:.1f} to {upper:.1f})'
        if math.isnan(size):
            size_text = f'unknown ({end["size_status"].replace("_", " ")})'
            if math.isfinite(lower):
                size_text = f'{lower:.1f} to {upper:.1f} beads'
        true_size = end['true_cluster_size']
        truth = '' if math.isnan(true_size) else f', true {true_size:.1f}'
        print(
            f'tray {number}: clusters at the end {size_text}{truth}; '
            f'area {end["level_area"] * 1e6:.3f}'
            f" mm2, axes ratio {end['axes_ratio']:.2f}; onset by the paper's rule "
            f'{end["paper_onset"]:.1f} s'
        )


def _last_estimate(tray: CycleClusters) -> dict[str, Any]:
    last = tray.estimates[-1]
    return {
        'pictures': len(tray.estimates),
        'level_area': last.level_area,
        'breadth': last.breadth,
        'axes_ratio': last.axes_ratio,
        'direction': last.direction,
        'cluster_size': last.cluster_size.value,
        'cluster_size_error': last.cluster_size.error,
        'cluster_size_lower': last.cluster_size.lower,
        'cluster_size_upper': last.cluster_size.upper,
        'size_status': last.size_status.name.lower(),
        'true_cluster_size': float(tray.true_sizes()[-1]),
        'paper_onset': tray.paper_onset(),
        'true_onset': tray.true_onset(),
    }
