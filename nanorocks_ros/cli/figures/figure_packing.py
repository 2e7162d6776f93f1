"""``nanorocks figure packing``: filling factors and compaction of clusters (figure 10)."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.tray_options import add_trays
from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.analysis.cluster_packing import PackingCurve

PICTURES = ('.png', '.pdf', '.svg')
_TEXT = 'packing of clusters, measured or simulated with the truth (figure 10)'


def add_parser(kinds: Any) -> None:
    """Add the kind to those of ``nanorocks figure``."""
    parser = kinds.add_parser('packing', help=_TEXT, description=_TEXT)
    parser.add_argument(
        'results', nargs='?', help='folder of results of `nanorocks analyse`; not with --simulate'
    )
    parser.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
    add_trays(parser, 'trays; default: all in the results, or 1 3 5 with --simulate')
    parser.add_argument(
        '--simulate', action='store_true', help='simulate and film trays with sticking beads'
    )
    parser.add_argument('--cycles', type=int, default=6, help='simulated cycles; default 6')
    parser.add_argument(
        '--sticking-speed',
        type=float,
        default=0.003,
        help='[m/s] simulated sticking speed; default 0.003',
    )
    parser.add_argument(
        '--mean-speed',
        type=float,
        default=0.010,
        help='[m/s] simulated mean speed after a shaking event; default 0.01',
    )
    parser.add_argument(
        '--restitution', type=float, default=0.89, help='simulated restitution; default 0.89'
    )
    parser.add_argument(
        '--seed', type=int, default=1, help='random seed of the simulation; default 1'
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument('--force', action='store_true', help='replace a picture that exists')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read or simulate, draw and print, and return the exit code."""
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.outputs.atomic_files import check_outputs

    path = Path(options.output)
    check_outputs({'--output': path}, {'--output': PICTURES}, force=options.force)
    if (options.results is None) != options.simulate:
        raise ConfigurationError(
            'results, --simulate',
            'both are given' if options.simulate else 'neither is given',
            'name results of `nanorocks analyse`, or pass --simulate',
        )
    numbers = options.trays
    if options.simulate:
        numbers = numbers or (1, 3, 5)
    else:
        from nanorocks_ros.studies.analysis.results.result_tables import trays_of

        numbers = numbers or trays_of(Path(options.results), 'cluster')
    all_trays = load_trays(_trays_file(options.results))
    trays = {number: tray_by_number(all_trays, number) for number in numbers}
    curves = (_simulate_curves if options.simulate else _read_curves)(options, trays)

    from nanorocks_ros.studies.figures.packing_figure import packing_figure

    tray_values = packing_figure(path, trays, curves)
    if options.json:
        print(json.dumps({'simulated': options.simulate, 'trays': tray_values}, allow_nan=False))
    else:
        _print(tray_values)
    print(f'nanorocks: {len(trays)} tray{"s" * (len(trays) > 1)} in {path}', file=sys.stderr)
    return 0


def _trays_file(results: str | None) -> str:
    """The trays file that the results were made with."""
    from nanorocks_ros.studies.analysis.results.results_folder import trays_file_of

    return trays_file_of(Path(results)) if results else ''


def _read_curves(
    options: argparse.Namespace, trays: dict[int, Tray]
) -> dict[int, Sequence[PackingCurve]]:
    from nanorocks_ros.studies.analysis.cluster_packing import measured_packing

    return {number: measured_packing(Path(options.results), number) for number in trays}


def _simulate_curves(
    options: argparse.Namespace, trays: dict[int, Tray]
) -> dict[int, Sequence[PackingCurve]]:
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.studies.analysis.simulated_packing import simulated_packing

    settings = SimulationSettings(
        sticking_speed=options.sticking_speed,
        mean_speed=options.mean_speed,
        restitution=options.restitution,
        seed=options.seed,
    )
    curves: dict[int, Sequence[PackingCurve]] = {}
    for number, tray in trays.items():
        with Progress(f'filming tray {number}') as bar:
            curves[number] = simulated_packing(tray, settings, options.cycles, progress=bar.count)
    return curves


def _print(tray_values: dict[str, Any]) -> None:
    for number, values in tray_values.items():
        text = f'tray {number}, {values["cycles"]} cycles: '
        text += f"compaction by the paper's rule {_percent(values, 'apparent_compaction')}"
        if values['true_compaction'] is not None:
            text += f', true {_percent(values, "true_compaction")}'
        if values['layer_filling'] is not None:
            text += (
                f'; filling {values["layer_filling"]:.3f} as a layer, '
                f'{values["filling_in_space"]:.3f} in space, '
                f"{values['paper_filling']:.3f} by the paper's formula"
            )
        print(text)


def _percent(values: dict[str, Any], name: str) -> str:
    error = values[f'{name}_error']
    return f'{100 * values[name]:.1f}' + (f' ± {100 * error:.1f}' if error else '') + ' %'
