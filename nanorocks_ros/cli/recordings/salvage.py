"""``nanorocks salvage BAG -o BAG2``: a whole bag from a damaged one."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'salvage', help='copy what can be read of a damaged bag into a new one'
    )
    parser.add_argument('bag', help='rosbag2 folder, .mcap or .db3 file; it is only read')
    parser.add_argument('-o', '--output', required=True, help='bag to make')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Salvage, print; the exit code."""
    from nanorocks_ros.cli.progress import Progress
    from nanorocks_ros.outputs.safe_text import printable
    from nanorocks_ros.recordings.bag.salvage import salvage

    with Progress('salvaging') as progress:
        found = salvage(Path(options.bag), Path(options.output), progress.count)
    for notice in found.notices:
        print(f'nanorocks: {printable(notice)}', file=sys.stderr)
    if options.json:
        values = {
            'messages_recovered': found.recovered,
            'messages_lost': found.lost,
            'bag': str(found.bag),
            'notices': list(found.notices),
        }
        print(json.dumps(values))
    else:
        lost = f'{found.lost} known to be lost'
        print(f'{printable(found.bag)}: {found.recovered} messages recovered, {lost}')
    return 0
