"""``nanorocks figure cor RESULTS``: figures 7, 12 and 13 of the paper for one tray."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.cli.parsing.tray_options import add_tray
from nanorocks_ros.cli.remedies import print_notices
from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.figures.cor_figures import CorData, Search

_TEXT = 'the decay, the search over simulated runs, and restitution against speed (7, 12, 13)'
_EPILOG = """\
Writes decay.png (figure 7, with the simulated decay of best fit), walls.png and width.png
(figure 12: chi square over the restitutions of beads and walls, and over the restitution and the
width of its distribution), and cor_against_speed.png (figure 13). The same command resumes an
interrupted search. The paper has 178 runs at each point: --runs 178. Example:

  nanorocks analyse BAG && nanorocks figure cor BAG_results -o figures
"""
# Cooling window of `nanorocks analyse`, where the results have none.
_FIRST, _LAST = 1.75, 20.0


def add_parser(kinds: Any) -> None:
    """Add the kind to those of ``nanorocks figure``."""
    parser = kinds.add_parser(
        'cor',
        help=_TEXT,
        description=_TEXT,
        epilog=_EPILOG,
    )
    parser.add_argument('source', help='folder of results of `nanorocks analyse`, or a bag')
    parser.add_argument('-o', '--output', required=True, help='folder for the figures')
    add_tray(parser, 'number of the tray; required with several trays')
    parser.add_argument(
        '--runs', type=int, default=20, help='runs at each point of the search; default 20'
    )
    parser.add_argument(
        '--beads', default='0.5:1:26', help='restitutions of the beads; default 0.5:1:26'
    )
    parser.add_argument(
        '--walls', default='0.8:1:11', help='restitutions of the walls; default 0.8:1:11'
    )
    parser.add_argument(
        '--widths',
        default='0:0.16:5',
        help='widths of the distribution of restitutions; default 0:0.16:5',
    )
    parser.add_argument(
        '--wall-restitution',
        type=float,
        default=0.99,
        help='restitution of the walls in width.png and cor_against_speed.png; default 0.99',
    )
    parser.add_argument(
        '--first',
        type=float,
        help='[s] start of the fit, since the shaking event; default: as analysed',
    )
    parser.add_argument('--last', type=float, help='[s] end of the fit; default: as analysed')
    parser.add_argument('--parameters', help='ROS parameter file for the analysis of a bag')
    parser.add_argument('--seed', type=int, default=1, help='random seed of the runs; default 1')
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument(
        '--scheduler', metavar='tcp://HOST:PORT', help='scheduler of a Dask cluster'
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.leave_out('--beads', '--walls', '--widths', '--first', '--last')
    parser.leave_out('--parameters', '--scheduler')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read or analyse, search, draw and print, and return the exit code."""
    from nanorocks_ros.cli.progress_bar import RunProgress
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.studies.figures.cor_figures import Reports, cor_figures, prepare_folder

    search = _search(options)
    workers = Workers(processes=options.workers, scheduler=options.scheduler)
    workers.check()
    folder = Path(options.output)
    source = Path(options.source)
    if _is_bag(source):
        settings = _settings(options, source)
        prepare_folder(folder)
        source = _analyse_bag(settings, source, folder / 'results')
    data = _data(options, source)
    prepare_folder(folder)
    bars: dict[str, RunProgress] = {}

    def progress(name: str, done: int, total: int) -> None:
        if name not in bars:
            bars[name] = RunProgress(name).__enter__()
        bars[name].update(done, total)

    def notice(text: str) -> None:
        tell(text)

    try:
        values = cor_figures(
            folder, data, search, workers, Reports(progress=progress, notice=notice)
        )
    finally:
        for bar in bars.values():
            bar.__exit__()
    if options.json:
        print(json.dumps(_as_json(data, values), allow_nan=False))
    _print(data, values, folder)
    return 0


def _search(options: argparse.Namespace) -> Search:
    from nanorocks_ros.cli.simulation.sweep import values_of
    from nanorocks_ros.studies.figures.cor_figures import Search

    def values(text: str, flag: str) -> tuple[float, ...]:
        return tuple(float(value) for value in values_of(text, flag))

    return Search(
        beads=values(options.beads, '--beads'),
        walls=values(options.walls, '--walls'),
        widths=values(options.widths, '--widths'),
        runs=options.runs,
        seed=options.seed,
    )


def _is_bag(path: Path) -> bool:
    return path.suffix in ('.mcap', '.db3') or any(
        True for pattern in ('metadata.yaml', '*.mcap', '*.db3') for _ in path.glob(pattern)
    )


def _settings(options: argparse.Namespace, bag: Path) -> PipelineSettings:
    """Settings for a bag that shows one tray, or of which one is named."""
    from nanorocks_ros.cli.flags import bag_settings

    if options.tray is not None:
        options.trays = [str(options.tray)]
    settings, notices, trays_known = bag_settings(options, bag)
    if not trays_known or len(settings.trays) != 1:
        problem = 'is required with a bag that does not say which single tray it shows'
        raise ConfigurationError('--tray', problem, 'name the tray')
    print_notices(notices, options)
    options.tray = settings.trays[0]
    return settings


def _analyse_bag(settings: PipelineSettings, bag: Path, folder: Path) -> Path:
    """Analyse a bag into a folder beside the figures."""
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.studies.analysis.offline_analysis import analyse
    from nanorocks_ros.studies.analysis.results.results_folder import (
        check_results_folder,
        write_results,
    )

    scratch = check_results_folder(folder)
    with Progress('analysing') as progress:
        analysis = analyse(bag, settings, progress=progress.count, scratch=scratch)
    for notice in analysis.notices:
        tell(notice)
    write_results(analysis, folder, bag, settings)
    return folder


def _data(options: argparse.Namespace, source: Path) -> CorData:
    from nanorocks_ros.experiment.trays import tray_by_number
    from nanorocks_ros.studies.analysis.results.published_cycles import (
        published_cycles,
        published_lines,
        truth_of,
    )
    from nanorocks_ros.studies.decays.cooling_curves import (
        read_cycles,
        species_cycles,
        speed_table,
    )
    from nanorocks_ros.studies.decays.cooling_windows import cooling_window, span_of
    from nanorocks_ros.studies.figures.cor_figures import CorData
    from nanorocks_ros.studies.results.results_provenance import trays_of_results

    table, number = speed_table(source, options.tray)
    if number is None:
        raise ConfigurationError(str(table), 'does not say of which tray', 'add --tray K')
    tray = tray_by_number(trays_of_results(table.parent), number)
    cycles = read_cycles(table)
    window = cooling_window(table)
    default_span = (window.first, window.last) if window else (_FIRST, _LAST)
    if not 0.0 <= options.wall_restitution <= 1.0:
        raise ConfigurationError(
            '--wall-restitution', f'{options.wall_restitution:g}', 'give a number from 0 to 1'
        )
    return CorData(
        tray=tray,
        cycles=cycles,
        species=species_cycles(table, tray),
        span=span_of(options.first, options.last, default_span),
        start=window.start if window else 0.0,
        wall_restitution=options.wall_restitution,
        published=tuple(
            published_lines(published_cycles(table, number), truth_of(table.parent, number))
        ),
    )


def _as_json(data: CorData, values: dict[str, Any]) -> dict[str, Any]:
    from nanorocks_ros.studies.figures.instantaneous_figure import instantaneous_values

    instantaneous = values['instantaneous']
    return {
        'tray': data.tray.number,
        'cycles': len(data.cycles),
        'first': data.span[0],
        'last': data.span[1],
        **values,
        'instantaneous': None if instantaneous is None else instantaneous_values(instantaneous),
    }


def _print(data: CorData, values: dict[str, Any], folder: Path) -> None:
    library = values['decay']['library']
    if library is not None:
        print(
            f'nanorocks: simulated decays: beads {library["restitution"]:.3f} '
            f'[{library["restitution_lower"]:.3f}, {library["restitution_upper"]:.3f}], '
            f'walls {library["wall_restitution"]:.3f} [{library["wall_restitution_lower"]:.3f}, '
            f'{library["wall_restitution_upper"]:.3f}]',
            file=sys.stderr,
        )
    for name in ('walls', 'width'):
        best = ', '.join(f'{key} {value:g}' for key, value in values[name]['best'].items())
        print(
            f'nanorocks: search, {name}: best at {best}; other points may agree as well, '
            'see the map',
            file=sys.stderr,
        )
    cycles = f'{len(data.cycles)} cycles' if len(data.cycles) > 1 else 'a cycle'
    print(f'nanorocks: {cycles} of tray {data.tray.number} in {folder}', file=sys.stderr)
