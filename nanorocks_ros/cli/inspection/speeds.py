"""``nanorocks speeds BAG``: mean speeds by each method, compared with the truth.

Tested by ``test/studies/inspection/test_speed_comparison.py``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.outputs.json_values import json_values

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.inspection.speed_comparison import BagSpeeds, ComparedSpeeds


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser(
        'speeds', help='measure the speed by each method, and compare them'
    )
    add_bag(parser, skip={'speed.method'})
    parser.add_argument('-o', '--output', help='picture of one cycle to write, .png')
    parser.add_argument('--table', help='table of all speeds to write, .csv')
    parser.add_argument(
        '--cycle',
        type=int,
        metavar='N',
        help='cycle to draw; default: the first after a shaking event',
    )
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure speeds, print and write them, and return the exit code."""
    from nanorocks_ros.cli.flags import bag_settings
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.inspection.speed_comparison import compare_speeds

    names = {'--output': options.output, '--table': options.table}
    files = {flag: Path(name) for flag, name in names.items() if name}
    check_outputs(files, {'--output': ('.png',), '--table': ('.csv',)}, force=options.force)
    settings, assumed, _ = bag_settings(options, options.bag)
    with interruption_says('nothing was written'), Progress('measuring') as progress:
        speeds = compare_speeds(
            Path(options.bag),
            settings,
            image_topic=options.image_topic,
            progress=progress.count,
        )
    print_notices((*assumed, *speeds.notices), options)
    cycle = _cycle(speeds, options.cycle)
    if options.json:
        print(json.dumps(_as_json(speeds), allow_nan=False))
    else:
        _print(speeds, cycle)
    _write(files, speeds, cycle)
    return 0


def _cycle(speeds: BagSpeeds, cycle: int | None) -> int:
    if cycle is None:
        return speeds.first_cycle()
    cycles = sorted({number for tray in speeds.trays.values() for number in tray.cycles})
    if cycle not in cycles:
        listed = ', '.join(str(number) for number in cycles) or 'none'
        raise ConfigurationError(
            '--cycle', f'{cycle}, but speeds were measured in {listed}', 'choose one of these'
        )
    return cycle


def _write(files: dict[str, Path], speeds: BagSpeeds, cycle: int) -> None:
    if '--table' in files:
        from nanorocks_ros.studies.inspection.speed_comparison import write_speeds

        write_speeds(files['--table'], speeds)
        print(f'nanorocks: speeds in {files["--table"]}', file=sys.stderr)
    if '--output' in files:
        from nanorocks_ros.studies.inspection.speeds_figure import speeds_figure

        speeds_figure(files['--output'], speeds, cycle)
        print(f'nanorocks: picture in {files["--output"]}', file=sys.stderr)


def _as_json(speeds: BagSpeeds) -> dict[str, Any]:
    return {
        'frames': speeds.frames,
        'trays': {
            str(number): {
                'methods': {name: _method_as_json(speeds, tray, name) for name in tray.speeds},
                'chosen': tray.chosen(),
                'cycles': tray.cycles,
            }
            for number, tray in speeds.trays.items()
        },
    }


def _method_as_json(bag: BagSpeeds, tray: ComparedSpeeds, method: str) -> dict[str, Any]:
    estimates, ratios = tray.speeds[method], tray.ratios(method)
    return {
        'time': [(speed.stamp_ns - bag.epoch_ns) / 1e9 for speed in estimates],
        'cycle': [speed.cycle for speed in estimates],
        'mean_projected_speed': json_values(
            [speed.mean_projected_speed.value for speed in estimates]
        ),
        'mean_projected_speed_error': json_values(
            [speed.mean_projected_speed.error for speed in estimates]
        ),
        'window': [speed.window for speed in estimates],
        'method': [speed.method.name.lower() for speed in estimates],
        'quality': [speed.quality.names() for speed in estimates],
        'true_mean_projected_speed': json_values(tray.true_speeds(estimates)),
        'ratio_to_truth': float(ratios.mean()) if ratios.size else None,
        'ratio_to_truth_scatter': float(ratios.std()) if ratios.size else None,
    }


def _print(speeds: BagSpeeds, cycle: int) -> None:
    print(f'{speeds.frames} frames')
    for number, tray in speeds.trays.items():
        print(f'tray {number}, cycle {cycle}:')
        for method, estimates in tray.speeds.items():
            count = sum(speed.cycle == cycle for speed in estimates)
            ratios = tray.ratios(method, cycle)
            ratio_text = (
                f', estimate / truth {ratios.mean():.3f} (sd {ratios.std():.3f})'
                if ratios.size
                else ''
            )
            print(f'  {method}: {count} speeds{ratio_text}')
        shares = tray.chosen(cycle).items()
        shares_text = ', '.join(f'{name} {100 * share:.0f} %' for name, share in shares if share)
        print(f'  chosen from the data: {shares_text or "nothing"}')
