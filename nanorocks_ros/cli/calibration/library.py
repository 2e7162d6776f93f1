"""``nanorocks library``: simulated decays of a tray, to compare measured decays with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.cli.parsing.tray_options import add_tray, add_trays_file

if TYPE_CHECKING:
    import argparse


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_flags
    from nanorocks_ros.settings import SimulationSettings, rows
    from nanorocks_ros.settings.simulation_settings import LAW_SETTINGS

    parser = commands.add_parser(
        'library', help='simulate the decays of a tray from which restitutions are inferred'
    )
    add_tray(parser, 'tray to simulate', required=True)
    parser.add_argument('-o', '--output', required=True, help='file to write, .npz')
    add_trays_file(parser)
    parser.add_argument('--nodes', type=int, default=800, help='simulated points; default 800')
    parser.add_argument(
        '--rough-nodes',
        type=int,
        default=600,
        help='simulated points of beads that rub along walls and each other; default 600, 0: none',
    )
    parser.add_argument('--runs', type=int, default=12, help='runs at each point; default 12')
    parser.add_argument('--seed', type=int, default=1, help='random seed; default 1')
    parser.add_argument(
        '--drag',
        type=float,
        default=0.0,
        help='gas that slows beads of the first species at this rate in 1/s, at a mean speed of '
        '10 mm/s at the start; default 0: vacuum, which `analyse` needs',
    )
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument(
        '--scheduler', metavar='tcp://HOST:PORT', help='scheduler of a Dask cluster'
    )
    parser.add_argument('--force', action='store_true', help='replace a file that exists')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    settings = SimulationSettings()
    skipped = {row.name for row in rows(settings)} - set(LAW_SETTINGS)
    add_flags(
        parser, settings, skipped, 'laws that are not constant; `analyse` needs constant ones'
    )
    parser.leave_out('--rough-nodes', '--drag', '--scheduler')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Simulate, write and print, and return the exit code."""
    from nanorocks_ros.cli.calibration.finished_output import is_finished
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.inference.decay.decay_library_file import load_library
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.libraries.decay_simulations import build_library
    from nanorocks_ros.studies.libraries.library_nodes import LibraryPlan

    output = Path(options.output)
    plan = LibraryPlan(
        tray=tray_by_number(load_trays(options.trays_file or None), options.tray),
        nodes=options.nodes,
        rough_nodes=options.rough_nodes,
        runs=options.runs,
        seed=options.seed,
        drag=options.drag,
        law=_law(options),
    )
    if is_finished(options, plan.specification()):
        library = load_library(str(output), packaged=False)
    else:
        check_outputs({'--output': output}, {'--output': ('.npz',)}, force=options.force)
        workers = Workers(processes=options.workers, scheduler=options.scheduler)
        with Progress(f'decays of tray {options.tray}') as progress:
            library = build_library(
                plan,
                output,
                workers,
                progress.count,
                tell,
            )
    if options.json:
        summary = {'output': str(output), 'misfit': library.misfit, **json.loads(library.made_by)}
        print(json.dumps(summary))
    else:
        print(f'{output}: misfit {100.0 * library.misfit:.1f} % beyond the noise of its runs')
    return 0


def _law(options: argparse.Namespace) -> dict[str, Any]:
    """The settings of the law, checked; empty for constant restitutions."""
    import argparse

    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.settings.simulation_settings import LAW_SETTINGS

    default = SimulationSettings()
    # Other options have names of settings, too.
    of_law = argparse.Namespace(**{name: getattr(options, name) for name in LAW_SETTINGS})
    given = settings_from(of_law, default)
    law = {name: getattr(given, name) for name in LAW_SETTINGS}
    return law if any(law[name] != getattr(default, name) for name in law) else {}
