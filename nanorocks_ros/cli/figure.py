"""``nanorocks figure KIND SPEEDS``: figures of measured decays, as in the paper."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.physics.instantaneous import InstantaneousCor

_PICTURES = ('.png', '.pdf', '.svg')
_KINDS = {
    'decay': "energy of the beads as they cool, with our fit and the paper's (its figure 7)",
    'instantaneous': 'restitution against speed, and what noise alone makes of it (figure 13)',
}


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli import figure_dust, figure_long_term, figure_packing

    parser = commands.add_parser('figure', help='draw measured decays as the paper does')
    kinds = parser.add_subparsers(dest='kind', metavar='KIND', required=True)
    figure_packing.add_parser(kinds)
    figure_dust.add_parser(kinds)
    figure_long_term.add_parser(kinds)
    for kind, text in _KINDS.items():
        one = kinds.add_parser(kind, help=text, description=text)
        one.add_argument('speeds', help='results of `nanorocks analyse`, or their table of speeds')
        one.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
        one.add_argument('--tray', type=int, help='where there are several')
        one.add_argument(
            '--wall-restitution', type=float, default=0.99, help='taken for known; default 0.99'
        )
        one.add_argument(
            '--first', type=float, default=0.5, help='[s] since the shaking event; default 0.5'
        )
        one.add_argument('--last', type=float, default=20.0, help='[s]; default 20')
        one.add_argument('--trays', default='', help='YAML file of trays; default: those flown')
        one.add_argument('--json', action='store_true', help='print one JSON object, SI units')
        one.add_argument('--force', action='store_true', help='replace a picture that exists')
        one.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read, draw, print; the exit code."""
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.study.cycles import read_cycles, speed_table
    from nanorocks_ros.study.decay_figure import decay_figure
    from nanorocks_ros.study.instantaneous_figure import instantaneous_figure
    from nanorocks_ros.study.output_files import check_outputs

    path = Path(options.output)
    check_outputs({'--output': path}, {'--output': _PICTURES}, force=options.force)
    if not 0.0 <= options.first < options.last:
        raise ConfigurationError(
            '--first, --last',
            f'{options.first:g} to {options.last:g} s',
            'give two times, rising, none below 0',
        )
    table, number = speed_table(Path(options.speeds), options.tray)
    if number is None:
        raise ConfigurationError('--tray', 'is not known from the name', 'name the tray')
    tray = tray_by_number(load_trays(options.trays), number)
    cycles = read_cycles(table)
    given = {
        'wall_restitution': options.wall_restitution,
        'span': (options.first, options.last),
    }
    if options.kind == 'decay':
        values: dict[str, Any] = decay_figure(path, tray, cycles, **given)
    else:
        values = _as_json(instantaneous_figure(path, tray, cycles, **given))
    if options.json:
        shown = {'tray': number, 'cycles': len(cycles), **values}
        print(json.dumps(shown, allow_nan=False))
    many = f'{len(cycles)} cycles' if len(cycles) > 1 else 'a cycle'
    print(f'nanorocks: {many} of tray {number} in {path}', file=sys.stderr)
    return 0


def _as_json(found: InstantaneousCor) -> dict[str, Any]:
    local = found.local
    arrays = {
        'collision_speed': found.collision_speed,
        'paper_restitution': found.paper,
        'noise_95': found.noise[[0, 3]],
        'noise_and_gas_95': found.noise_and_gas[[0, 3]],
        'local_speed': local.speed,
        'local_decay_rate': local.decay_rate,
        'local_decay_rate_error': local.decay_rate_error,
        'local_restitution': local.restitution,
        'local_restitution_lower': local.lower,
        'local_restitution_upper': local.upper,
    }
    return {name: _known(array.tolist()) for name, array in arrays.items()}


def _known(value: Any) -> Any:
    """Numbers as JSON has them: null for NaN."""
    if isinstance(value, list):
        return [_known(one) for one in value]
    return value if math.isfinite(value) else None
