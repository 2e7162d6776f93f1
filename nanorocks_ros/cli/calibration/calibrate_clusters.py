"""``nanorocks cluster-curve``: calibration of cluster sizes by films of simulated clusters.

Tested by ``test/studies/libraries/test_cluster_simulations.py``.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.cli.parsing.tray_options import add_tray, add_trays, add_trays_file
from nanorocks_ros.outputs.json_values import finite_or_none

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.inference.cluster_size.size_from_width import ClusterCurve
    from nanorocks_ros.studies.libraries.cluster_films import ClusterPlan

_MAX_STRENGTH = 2.0


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'cluster-curve', help='calibrate cluster sizes with films of simulated clusters'
    )
    add_trays(parser, 'trays to film; default: all')
    add_tray(parser, argparse.SUPPRESS, action='append')
    parser.add_argument('-o', '--output', required=True, help='file to write, .npz')
    add_trays_file(parser)
    parser.add_argument('--runs', type=int, default=128, help='number of films; default 128')
    parser.add_argument(
        '--level',
        type=float,
        default=0.5,
        help='level of the contour, as clusters.level; default 0.5',
    )
    parser.add_argument(
        '--strengths',
        type=float,
        nargs=2,
        default=(0.0, 1.5),
        metavar=('LOW', 'HIGH'),
        help='range of the effects of camera, light and dust, relative to flight; default 0 1.5',
    )
    parser.add_argument('--seed', type=int, default=1, help='random seed; default 1')
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument(
        '--scheduler', metavar='tcp://HOST:PORT', help='scheduler of a Dask cluster'
    )
    parser.add_argument('--force', action='store_true', help='replace a file that exists')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Film, measure, write and print, and return the exit code."""
    from nanorocks_ros.cli.calibration.finished_output import is_finished
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.inference.cluster_size.cluster_curve import curve_key, load_curves
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.libraries.cluster_simulations import build_curves

    output = Path(options.output)
    plan = _plan(options)
    if is_finished(options, plan.specification()):
        curves = load_curves(str(output), packaged=False)
    else:
        check_outputs({'--output': output}, {'--output': ('.npz',)}, force=options.force)
        workers = Workers(processes=options.workers, scheduler=options.scheduler)
        with Progress('films of clusters') as progress:
            curves = build_curves(
                plan,
                output,
                workers,
                progress.count,
                tell,
            )
    tray_curves = {number: curves[curve_key(plan.cells[number])] for number in plan.trays}
    if options.json:
        values = {str(number): _values(curve) for number, curve in tray_curves.items()}
        print(
            json.dumps(
                {'output': str(output), 'trays': values, **json.loads(plan.specification())}
            )
        )
        return 0
    for number, curve in tray_curves.items():
        print(f'tray {number}: {_sentence(curve)}')
    return 0


def _plan(options: argparse.Namespace) -> ClusterPlan:
    from nanorocks_ros.errors import ConfigurationError
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.settings import PipelineSettings, with_values
    from nanorocks_ros.studies.libraries.cluster_films import ClusterPlan

    with_values(PipelineSettings(), {'clusters.level': options.level}, '--level')
    if options.seed < 0:
        raise ConfigurationError('--seed', f'{options.seed}', 'give 0 or more')
    weak, strong = options.strengths
    if not 0.0 <= weak <= strong <= _MAX_STRENGTH:
        raise ConfigurationError(
            '--strengths',
            f'{weak:g} {strong:g}',
            f'give two rising numbers from 0 to {_MAX_STRENGTH:g}',
        )
    trays = load_trays(options.trays_file or None)
    numbers = tuple(sorted({*options.trays, *(options.tray or ())} or set(trays)))
    for number in numbers:
        tray_by_number(trays, number)
    return ClusterPlan(
        cells=trays,
        trays=numbers,
        runs=options.runs,
        seed=options.seed,
        level=options.level,
        strengths=(weak, strong),
    )


def _values(curve: ClusterCurve) -> dict[str, Any]:
    return {
        'largest': finite_or_none(curve.largest),
        'sizes': [math.exp(log_size) for log_size in curve.log_size],
        'readings': curve.reading.tolist(),
        'weight': curve.weight,
        'scatter': curve.scatter.tolist(),
        'pictures': len(curve.samples),
    }


def _sentence(curve: ClusterCurve) -> str:
    if math.isnan(curve.largest):
        return 'the autocorrelation does not depend on the size of its clusters'
    return f'sizes up to {curve.largest:.1f} beads'
