"""``nanorocks simulate``: a simulated tray, filmed into a bag with the truth beside it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.experiment.settings import SimulationSettings

if TYPE_CHECKING:
    import argparse


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_flags

    parser = commands.add_parser('simulate', help='film a simulated tray into a bag')
    parser.add_argument('--bag', required=True, help='rosbag2 folder to write')
    parser.add_argument('--duration', type=float, default=60.0, help='[s]; default 60')
    parser.add_argument('--quality', type=int, default=90, help='of the JPEGs, 1 to 100')
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    add_flags(parser, SimulationSettings(), skip=set())
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Film the tray; the exit code."""
    from tqdm import tqdm

    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.study.film_bag import film_into_bag

    settings = settings_from(options, SimulationSettings())
    with tqdm(unit='frame', leave=False, disable=None) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        filmed = film_into_bag(
            Path(options.bag),
            settings,
            duration=options.duration,
            quality=options.quality,
            progress=progress,
        )
    if options.json:
        print(json.dumps({**filmed, 'bag': options.bag}, allow_nan=False))
    else:
        print(f'nanorocks: {filmed["frames"]} frames in {options.bag}', file=sys.stderr)
    return 0
