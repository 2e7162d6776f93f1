"""``nanorocks figure decay | instantaneous SPEEDS``: measured decays (figures 7 and 13)."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds

_PICTURES = ('.png', '.pdf', '.svg')
_SPAN = (0.5, 20.0)
_KINDS = {
    'decay': "energy of the beads as they cool, with our fit and the paper's (its figure 7)",
    'instantaneous': 'restitution against speed, and what noise alone makes of it (figure 13)',
}


def add_parser(kinds: Any) -> None:
    """Add both kinds to those of ``nanorocks figure``."""
    for kind, text in _KINDS.items():
        parser = kinds.add_parser(kind, help=text, description=text)
        parser.add_argument(
            'speeds', help='results of `nanorocks analyse`, or their table of speeds'
        )
        parser.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
        parser.add_argument('--tray', type=int, help='where there are several')
        parser.add_argument(
            '--wall-restitution', type=float, default=0.99, help='taken for known; default 0.99'
        )
        parser.add_argument(
            '--first',
            type=float,
            help='[s] since the shaking event; default 0.5, as analysed where the tray swung on',
        )
        parser.add_argument('--last', type=float, help='[s]; default 20, or as analysed then')
        parser.add_argument('--trays', default='', help='YAML file of trays; default: those flown')
        parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
        parser.add_argument('--force', action='store_true', help='replace a picture that exists')
        parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read, draw, print; the exit code."""
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.decays.cooling_curves import read_cycles, speed_table

    path = Path(options.output)
    check_outputs({'--output': path}, {'--output': _PICTURES}, force=options.force)
    table, number = speed_table(Path(options.speeds), options.tray)
    if number is None:
        raise ConfigurationError('--tray', 'is not known from the name', 'name the tray')
    tray = tray_by_number(load_trays(options.trays), number)
    cycles = read_cycles(table)
    values = _drawn(options, table, tray, cycles)
    if options.json:
        shown = {'tray': number, 'cycles': len(cycles), **values}
        print(json.dumps(shown, allow_nan=False))
    many = f'{len(cycles)} cycles' if len(cycles) > 1 else 'a cycle'
    print(f'nanorocks: {many} of tray {number} in {path}', file=sys.stderr)
    return 0


def _drawn(
    options: argparse.Namespace, table: Path, tray: Tray, cycles: tuple[CycleSpeeds, ...]
) -> dict[str, Any]:
    """Draw the picture; its numbers."""
    from nanorocks_ros.studies.decays.cooling_curves import cooling_part, species_cycles
    from nanorocks_ros.studies.decays.cooling_windows import cooling_window, span_of
    from nanorocks_ros.studies.figures.decay_figure import decay_figure
    from nanorocks_ros.studies.figures.instantaneous_figure import (
        instantaneous_figure,
        instantaneous_values,
    )

    path, walls = Path(options.output), options.wall_restitution
    window = cooling_window(table)
    start = window.start if window else 0.0
    usual = (window.first, window.last) if window and start > 0.0 else _SPAN
    span = span_of(options.first, options.last, usual)
    if options.kind == 'decay':
        species = species_cycles(table, tray)
        return decay_figure(
            path, tray, cycles, wall_restitution=walls, span=span, species=species, start=start
        )
    cycles, span = cooling_part(cycles, span, start)
    return instantaneous_values(
        instantaneous_figure(path, tray, cycles, wall_restitution=walls, span=span)
    )
