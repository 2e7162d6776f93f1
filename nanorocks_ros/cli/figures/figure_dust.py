"""``nanorocks figure dust``: sticking thresholds and dust collision models (figure 14)."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.tray_options import add_trays_file
from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.physics.dust_models import MeasuredThreshold

_PICTURES = ('.png', '.pdf', '.svg')
_TEXT = 'sticking thresholds against mass, with published collision models (figure 14)'
_FORM = 'give TRAY:SPEED or TRAY:SPEED:LOWER:UPPER in m/s, such as 1:0.0104:0.009:0.012'


def add_parser(kinds: Any) -> None:
    """Add the kind to those of ``nanorocks figure``."""
    parser = kinds.add_parser('dust', help=_TEXT, description=_TEXT)
    parser.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
    parser.add_argument(
        '--measured',
        action='append',
        default=[],
        metavar='TRAY:SPEED[:LOWER:UPPER]',
        help='measured threshold [m/s]; may be repeated',
    )
    parser.add_argument('--no-paper', action='store_true', help="leave out the paper's points")
    parser.add_argument(
        '--restitution',
        type=float,
        default=0.89,
        help='restitution for the collapse time of a cloud; default 0.89',
    )
    add_trays_file(parser)
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument('--force', action='store_true', help='replace a picture that exists')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Draw and print, and return the exit code."""
    from nanorocks_ros.experiment.trays import load_trays
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.physics.dust_models import collapse_time_factor

    path = Path(options.output)
    check_outputs({'--output': path}, {'--output': _PICTURES}, force=options.force)
    factor = collapse_time_factor(options.restitution)
    trays = load_trays(options.trays_file)
    measured = [_threshold(text, trays) for text in options.measured]

    from nanorocks_ros.studies.figures.dust_figure import dust_figure, paper_thresholds

    paper = () if options.no_paper else paper_thresholds(trays)
    values = dust_figure(path, [*paper, *measured])
    values['collapse_time_factor'] = factor if factor < float('inf') else None
    values['restitution'] = options.restitution
    if options.json:
        print(json.dumps(values, allow_nan=False))
    else:
        _print(values)
    print(f'nanorocks: {len(values["points"])} thresholds in {path}', file=sys.stderr)
    return 0


def _threshold(text: str, trays: Mapping[int, Tray]) -> MeasuredThreshold:
    from nanorocks_ros.experiment.trays import tray_by_number
    from nanorocks_ros.studies.figures.dust_figure import threshold_of_tray

    words = text.split(':')
    try:
        number, (speed, *interval) = int(words[0]), [float(word) for word in words[1:]]
    except ValueError as error:
        raise ConfigurationError('--measured', f'{text!r} cannot be read', _FORM) from error
    if len(interval) not in (0, 2):
        raise ConfigurationError('--measured', f'{text!r} has one end of an interval only', _FORM)
    ends = (interval[0], interval[1]) if interval else None
    return threshold_of_tray(tray_by_number(trays, number), speed, ends)


def _print(values: dict[str, Any]) -> None:
    for point in values['points']:
        mark = '' if point['all_bounce_above_verified'] else ' (unverified)'
        print(
            f'tray {point["tray"]}: {1e3 * point["sticking_speed"]:.1f} mm/s at '
            f'{1e6 * point["mass"]:.2f} mg ({point["source"]}); published: all bounce above '
            f'{1e3 * point["all_bounce_above"]:.1f} mm/s{mark}'
        )
    factor = values['collapse_time_factor']
    cloud = f'a cloud of particles of restitution {values["restitution"]:g}'
    if factor is None:
        print(f'{cloud} never collapses')
    else:
        print(f'{cloud} takes {factor:.2f} times as long to collapse as with restitution 0')
