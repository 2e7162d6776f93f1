"""``nanorocks figure long-term RESULTS...``: evolution over all cycles (figure 9)."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.analysis.long_term import Campaign

_PICTURES = ('.png', '.pdf', '.svg')
_TEXT = 'peak speed, restitution and cluster size by cycle, trends, quiet periods (figure 9)'


def add_parser(kinds: Any) -> None:
    """Add the kind to those of ``nanorocks figure``."""
    parser = kinds.add_parser('long-term', help=_TEXT, description=_TEXT)
    parser.add_argument(
        'results', nargs='+', help='folders of results of `nanorocks analyse`, in order of time'
    )
    parser.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
    parser.add_argument('--table', help='also write all cycles as CSV')
    parser.add_argument(
        '--false-alarms',
        type=float,
        default=0.01,
        help='probability of a quiet period by chance in a campaign; default 0.01',
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read, find trends and quiet periods, draw and print, and return the exit code."""
    from nanorocks_ros.outputs.atomic_files import check_outputs

    files = {'--output': Path(options.output)}
    if options.table:
        files['--table'] = Path(options.table)
    check_outputs(files, {'--output': _PICTURES, '--table': ('.csv',)}, force=options.force)

    from nanorocks_ros.studies.analysis.long_term import read_campaign, write_campaign
    from nanorocks_ros.studies.figures.long_term_figure import campaign_values, long_term_figure

    campaign = read_campaign([Path(result) for result in options.results], options.false_alarms)
    long_term_figure(files['--output'], campaign)
    if options.table:
        write_campaign(campaign, files['--table'])
    if options.json:
        print(json.dumps(campaign_values(campaign), allow_nan=False))
    else:
        _print(campaign)
    names = ' and '.join(str(file) for file in files.values())
    print(f'nanorocks: {campaign.places} cycles in {names}', file=sys.stderr)
    return 0


def _print(campaign: Campaign) -> None:
    size = ('mm', 1e3) if campaign.measure.unit == 'm' else ('', 1.0)
    for (tray, name), trend in sorted(campaign.trends.items()):
        unit, scale = {
            'peak_speed': ('mm/s', 1e3),
            'restitution': ('', 1.0),
            'cluster_size': size,
        }[name]
        label = f'tray {tray}, {name.replace("_", " ")}'
        if trend.samples == 0:
            print(f'{label}: not known')
        elif trend.slope != trend.slope:
            print(f'{label}: no trend from {trend.samples} cycles')
        else:
            slope, error = scale * trend.slope, scale * trend.slope_error
            change = f'{slope:+.3g} ± {error:.2g} {unit}'.rstrip()
            print(f'{label}: {change} a cycle, {trend.samples} cycles')
    print(f'cluster size: {campaign.measure.text} ({campaign.measure.column})')
    for period in campaign.periods:
        print(
            f'quiet period: cycles {period.first + 1} to {period.last + 1}, clusters larger by '
            f'{period.excess:.1f} standard deviations, by chance in {100 * period.chance:.1f} %'
        )
    if not campaign.periods:
        print('no quiet period')
