"""``nanorocks figure decay | instantaneous SPEEDS``: figures 7 and 13 of measured decays."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.tray_options import add_tray, add_trays_file
from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds

_PICTURES = ('.png', '.pdf', '.svg')
_SPAN = (0.5, 20.0)
_KINDS = {
    'decay': "energy of the cooling beads, with our fit and the paper's (figure 7)",
    'instantaneous': 'restitution against speed, with the effect of noise alone (figure 13)',
}


def add_parser(kinds: Any) -> None:
    """Add both kinds to those of ``nanorocks figure``."""
    for kind, text in _KINDS.items():
        parser = kinds.add_parser(kind, help=text, description=text)
        parser.add_argument(
            'speeds', help='folder of results of `nanorocks analyse`, or a table of speeds'
        )
        parser.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
        add_tray(parser, 'number of the tray; required with several trays')
        parser.add_argument(
            '--wall-restitution',
            type=float,
            default=0.99,
            help='restitution of the walls; default 0.99',
        )
        parser.add_argument(
            '--first',
            type=float,
            help='[s] start of the fit, since the shaking event; default 0.5, or as analysed '
            'where the tray kept oscillating',
        )
        parser.add_argument(
            '--last', type=float, help='[s] end of the fit; default 20, or as analysed'
        )
        add_trays_file(parser, 'as analysed')
        parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
        parser.add_argument('--force', action='store_true', help='replace a picture that exists')
        parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read, draw and print, and return the exit code."""
    from nanorocks_ros.experiment.trays import tray_by_number
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.decays.cooling_curves import read_cycles, speed_table
    from nanorocks_ros.studies.results.results_provenance import trays_of_results

    path = Path(options.output)
    check_outputs({'--output': path}, {'--output': _PICTURES}, force=options.force)
    table, number = speed_table(Path(options.speeds), options.tray)
    if number is None:
        raise ConfigurationError(str(table), 'does not say of which tray', 'add --tray K')
    tray = tray_by_number(trays_of_results(table.parent, options.trays_file), number)
    cycles = read_cycles(table)
    values = _draw_figure(options, table, tray, cycles)
    if options.json:
        printed = {'tray': number, 'cycles': len(cycles), **values}
        print(json.dumps(printed, allow_nan=False))
    cycles_text = f'{len(cycles)} cycles' if len(cycles) > 1 else 'a cycle'
    print(f'nanorocks: {cycles_text} of tray {number} in {path}', file=sys.stderr)
    return 0


def _draw_figure(
    options: argparse.Namespace, table: Path, tray: Tray, cycles: tuple[CycleSpeeds, ...]
) -> dict[str, Any]:
    """Draw the picture, and return its numbers."""
    from nanorocks_ros.studies.analysis.results.published_cycles import (
        published_cycles,
        published_lines,
        truth_of,
    )
    from nanorocks_ros.studies.decays.cooling_curves import cooling_part, species_cycles
    from nanorocks_ros.studies.decays.cooling_windows import cooling_window, span_of
    from nanorocks_ros.studies.figures.decay_figure import decay_figure
    from nanorocks_ros.studies.figures.instantaneous_figure import (
        instantaneous_figure,
        instantaneous_values,
    )

    path, walls = Path(options.output), options.wall_restitution
    published = published_cycles(table, tray.number)
    lines = published_lines(published, truth_of(table.parent, tray.number))
    window = cooling_window(table)
    start = window.start if window else 0.0
    default_span = (window.first, window.last) if window and start > 0.0 else _SPAN
    span = span_of(options.first, options.last, default_span)
    if options.kind == 'decay':
        species = species_cycles(table, tray)
        values = decay_figure(
            path,
            tray,
            cycles,
            wall_restitution=walls,
            span=span,
            species=species,
            start=start,
            published=lines,
        )
        return {'published': lines, **values}
    cycles, span = cooling_part(cycles, span, start)
    cor = instantaneous_figure(
        path, tray, cycles, wall_restitution=walls, span=span, published=lines
    )
    return {'published': lines, **instantaneous_values(cor)}
