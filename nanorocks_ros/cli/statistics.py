"""``nanorocks statistics BAG``: the gas of each tray, from the tracks of its beads.

Tested by ``test/studies/gas_statistics/test_statistics_command.py``.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.gas_statistics.tray_statistics import GasChoices, TrayStatistics

_MM = 1e3


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser(
        'statistics',
        help='velocity distribution, energies, collisions, g(r) and S(k) of a bag',
    )
    add_bag(parser)
    parser.add_argument('-o', '--output', help='new folder for the tables and figures')
    parser.add_argument(
        '--from',
        dest='first',
        type=float,
        default=1.75,
        metavar='S',
        help='start of the part of each cycle that is used, since its shaking event [s]; '
        'default 1.75',
    )
    parser.add_argument(
        '--to', dest='last', type=float, default=math.inf, metavar='S', help='its end [s]'
    )
    parser.add_argument(
        '--restitution',
        type=float,
        default=0.9,
        metavar='E',
        help='of the gas of theory that collision rates are compared with; default 0.9',
    )
    parser.add_argument(
        '--wall-restitution',
        type=float,
        default=0.95,
        metavar='W',
        help='of the same, at the walls; default 0.95',
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure, print and write, and return the exit code."""
    from nanorocks_ros.cli.films.track import tracked_bag
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.gas_statistics.statistics_files import statistics_values
    from nanorocks_ros.studies.gas_statistics.tray_statistics import GasChoices

    choices = GasChoices(
        start=options.first,
        end=options.last,
        restitution=options.restitution,
        wall_restitution=options.wall_restitution,
    )
    folder = Path(options.output) if options.output else None
    check_outputs({'--output': folder} if folder else {}, {})
    bag = tracked_bag(options)
    statistics = _measure(bag, choices)
    if options.json:
        trays = {str(number): statistics_values(tray) for number, tray in statistics.items()}
        print(json.dumps({'frames': bag.frames, 'trays': trays}, allow_nan=False))
    else:
        for tray in statistics.values():
            _print(tray)
    if folder:
        _write(folder, statistics)
    return 0


def _measure(bag: TrackedBag, choices: GasChoices) -> dict[int, TrayStatistics]:
    """The statistics of each tray in which beads move; all others are told of."""
    from nanorocks_ros.errors import FitError
    from nanorocks_ros.studies.gas_statistics.tray_statistics import tray_statistics

    statistics = {}
    for number, tray in bag.trays.items():
        try:
            statistics[number] = tray_statistics(bag.tracks[number], tray, choices)
        except FitError as error:
            if len(bag.trays) == 1:
                raise
            tell(str(error))
            continue
        for notice in statistics[number].notices:
            tell(notice)
    if not statistics:
        raise FitError(
            'statistics', 'no tray has beads that move measurably', 'give an earlier start'
        )
    return statistics


def _write(folder: Path, statistics: dict[int, TrayStatistics]) -> None:
    from nanorocks_ros.studies.gas_statistics.statistics_figure import statistics_figure
    from nanorocks_ros.studies.gas_statistics.statistics_files import write_tables

    folder.mkdir(parents=True)
    write_tables(folder, statistics)
    for number, tray in statistics.items():
        statistics_figure(folder / f'tray_{number}.png', tray)
    print(f'nanorocks: tables and figures in {folder}', file=sys.stderr)


def _print(statistics: TrayStatistics) -> None:
    from nanorocks_ros.outputs.safe_text import counted

    print(
        f'tray {statistics.tray.number}: {counted(len(statistics.cycles), "cycle")}, '
        f'{statistics.seconds:.1f} s'
    )
    for kind, species in enumerate(statistics.tray.species):
        velocities, rate = statistics.velocities[kind], statistics.collisions[kind]
        ratio = statistics.energy_ratios[kind]
        if velocities is None:
            print(f'  {species.material}: not seen')
            continue
        a2, anisotropy = velocities.fourth_cumulant, velocities.anisotropy
        print(
            f'  {species.material}: a2 {a2.value:.3f} ± {a2.error:.3f}, '
            f'anisotropy {anisotropy.value:.3f} ± {anisotropy.error:.3f}'
        )
        if kind:
            print(f'    energy over that of the first {ratio.value:.2f} ± {ratio.error:.2f}')
        if rate is not None:
            free = rate.mean_free_path
            print(
                f'    {rate.per_path.value / _MM:.3f} ± {rate.per_path.error / _MM:.3f} '
                f'collisions per mm of projected path (theory {rate.theory_per_path / _MM:.3f}), '
                f'mean free path {_MM * free.value:.2f} ± {_MM * free.error:.2f} mm '
                f'(theory {_MM * rate.theory_mean_free_path:.2f})'
            )
        if (walls := statistics.wall_hits[kind]) is not None:
            print(
                f'    {walls.per_path.value / _MM:.3f} ± {walls.per_path.error / _MM:.3f} hits of '
                f'side walls per mm of projected path (theory {walls.theory_per_path / _MM:.3f})'
            )
    for cycle in statistics.clustering:
        if math.isfinite(cycle.onset):
            print(f'  cycle {cycle.cycle}: clustering from {cycle.onset:.1f} s on')
    if not any(math.isfinite(cycle.onset) for cycle in statistics.clustering):
        print('  no clustering in the structure factor')
