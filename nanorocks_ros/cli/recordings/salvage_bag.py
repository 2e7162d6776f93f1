"""``nanorocks salvage BAG -o BAG2``: copy the readable messages of a damaged bag.

Tested by ``test/cli/recordings/test_recordings.py``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from nanorocks_ros.cli.notices import tell


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'salvage', help='copy the readable messages of a damaged bag into a new one'
    )
    parser.add_argument('bag', help='rosbag2 folder, .mcap or .db3 file; it is not changed')
    parser.add_argument('-o', '--output', required=True, help='new bag')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Salvage the bag and print the result; returns the exit code."""
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.outputs.atomic_files import check_new_folder
    from nanorocks_ros.outputs.safe_text import printable
    from nanorocks_ros.recordings.bag.salvage import salvage

    check_new_folder(Path(options.output).parent)
    with Progress('salvaging') as progress:
        result = salvage(Path(options.bag), Path(options.output), progress.count)
    for notice in result.notices:
        tell(notice)
    if options.json:
        values = {
            'messages_recovered': result.recovered,
            'messages_lost': result.lost,
            'bag': str(result.bag),
            'notices': list(result.notices),
        }
        print(json.dumps(values))
    else:
        lost = f'{result.lost} known to be lost'
        print(f'{printable(result.bag)}: {result.recovered} messages recovered, {lost}')
    return 0
