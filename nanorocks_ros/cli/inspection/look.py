"""``nanorocks look BAG``: the steps of the preprocessing of one frame.

Tested by ``test/studies/inspection/test_preprocessing_steps.py``.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.outputs.json_values import finite_or_none

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.inspection.preprocessing_steps import FrameSteps, TraySteps

_MM, _MM2 = 1e3, 1e6


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser('look', help='show the preprocessing of one frame, step by step')
    add_bag(parser)
    moment = parser.add_mutually_exclusive_group()
    moment.add_argument(
        '--frame', type=int, metavar='N', help='frame to show, counted from 0; default: the middle'
    )
    moment.add_argument(
        '--at',
        type=float,
        metavar='SECONDS',
        help='time of the frame since the first frame of the bag',
    )
    parser.add_argument('-o', '--output', help='picture of the steps to write, .png')
    parser.add_argument('--force', action='store_true', help='replace a file that exists')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Process the bag up to the frame, print and draw it, and return the exit code."""
    from nanorocks_ros.cli.flags import bag_settings
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.inspection.preprocessing_steps import steps_of_bag

    _check_time(options)
    if options.output:
        check_outputs(
            {'--output': Path(options.output)}, {'--output': ('.png',)}, force=options.force
        )
    settings, assumed, _ = bag_settings(options, options.bag)
    with interruption_says('nothing was written'), Progress('looking') as progress:
        steps = steps_of_bag(
            Path(options.bag),
            settings,
            number=options.frame,
            time=options.at,
            image_topic=options.image_topic,
            progress=progress.count,
        )
    print_notices((*assumed, *steps.notices), options)
    if options.json:
        print(json.dumps(_as_json(steps), allow_nan=False))
    else:
        _print(steps)
    if options.output:
        from nanorocks_ros.studies.inspection.steps_figure import steps_figure

        steps_figure(Path(options.output), steps, settings.speed)
        print(f'nanorocks: picture in {options.output}', file=sys.stderr)
    return 0


def _check_time(options: argparse.Namespace) -> None:
    for flag, value in (('--frame', options.frame), ('--at', options.at)):
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise ConfigurationError(flag, f'{value:g}', 'count from 0')


def _as_json(steps: FrameSteps) -> dict[str, Any]:
    return {
        'frame': steps.number,
        'time': steps.time,
        'trays': {str(number): _tray_as_json(tray) for number, tray in steps.trays.items()},
    }


def _tray_as_json(steps: TraySteps) -> dict[str, Any]:
    image, tracks = steps.image, steps.tracks
    return {
        'cycle': image.cycle,
        'displacement': [finite_or_none(component) for component in image.displacement],
        'displacement_error': finite_or_none(image.displacement_error),
        'noise_power': finite_or_none(image.noise_power),
        'glare': finite_or_none(image.glare),
        'quality': image.quality.names(),
        'moving_area': steps.moving_area,
        'seen': None if tracks is None else int(tracks.seen.sum()),
        'expected': steps.tray.count,
    }


def _print(steps: FrameSteps) -> None:
    print(f'frame {steps.number} at {steps.time:.3f} s')
    for number, tray in steps.trays.items():
        flags = ', '.join(tray.image.quality.names()) or 'none'
        print(f'tray {number}: cycle {tray.image.cycle}, flags: {flags}')
        x, y = (_MM * value for value in tray.image.displacement)
        offset = f'{x:+.3f}, {y:+.3f} mm from its place'
        print(f'  the tray is {offset if math.isfinite(x) else "not tracked: no walls visible"}')
        if tray.tracks is not None:
            print(f'  {int(tray.tracks.seen.sum())} of {tray.tray.count} beads seen')
        if tray.moving_area is not None:
            print(f'  {_MM2 * tray.moving_area:.1f} mm^2 move')
