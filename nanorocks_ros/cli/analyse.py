"""``nanorocks analyse BAG...``: the coefficient of restitution from recordings.

Tested by ``test/studies/analysis/test_offline_analysis.py``.
"""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.cli.remedies import (
    about_own_recording,
    print_notices,
    results_beside,
    with_own_files,
)
from nanorocks_ros.errors import NanorocksError

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.analysis.offline_analysis import Analysis

_EPILOG = """\
Several bags, a pattern or a folder of bags are a batch. It uses one worker for each core, and the
same command resumes it. Failed bags are listed at the end (exit code 1). One report combines all
cycles.
Examples:

  nanorocks analyse flight/run_7
  nanorocks analyse 'flight/*' -o results
  nanorocks analyse day_1 day_2 -o results --scheduler tcp://10.0.0.1:8786 --format parquet
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.analyse_batch import add_options
    from nanorocks_ros.cli.flags import add_bag
    from nanorocks_ros.cli.imported_films import accept_films

    parser = commands.add_parser(
        'analyse',
        help='analyse one bag or many offline',
        epilog=_EPILOG,
    )
    add_bag(parser, many=True)
    accept_films(parser, 'bags', _announce_films)
    parser.add_argument(
        '-o',
        '--output',
        help='folder for tables and results bag; default BAG_results; required for many bags',
    )
    parser.add_argument(
        '--format',
        choices=('csv', 'parquet'),
        default='csv',
        help='format of the tables (many bags: of the tables of all cycles); default csv',
    )
    parser.add_argument('--no-output', action='store_true', help='write no files')
    parser.add_argument(
        '--include-inconsistent',
        dest='cooling.include_inconsistent',
        action='store_const',
        const='true',
        help='count decays that contacts contradict, too, in the means of all cycles',
    )
    add_options(parser)
    parser.leave_out('--no-output', '--include-inconsistent', '--scheduler')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Analyse one bag or many, print and write the results, and return the exit code."""
    from nanorocks_ros.cli.analyse_batch import is_batch, run_many
    from nanorocks_ros.outputs.tables.parquet import check_parquet

    # Checked before hours of work.
    check_parquet(Path(f'tables.{options.format}'))
    return run_many(options) if is_batch(options) else _run_one(options)


def _announce_films(options: argparse.Namespace, films: list[str]) -> None:
    """Say how films of unknown beads are measured: they do not tell which trays they show."""
    from nanorocks_ros.cli.flags import told_settings

    if told_settings(options, options.parameters) & {'trays', 'trays_file'}:
        return
    name, folder = shlex.quote(films[0]), shlex.quote(results_beside(films[0], 'measured'))
    text = (
        f'{films[0]}: does not say which trays it shows; tray 1 of the flight is assumed; name '
        f'another: nanorocks analyse {name} --trays 3; or measure a film of your own, whose '
        f'beads are found: nanorocks measure {name} --diameter-px auto -o {folder}'
    )
    tell(text)


def _run_one(options: argparse.Namespace) -> int:
    from nanorocks_ros.cli.flags import bag_settings
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.studies.analysis.offline_analysis import analyse
    from nanorocks_ros.studies.analysis.recognition_verdicts import EXIT_NOT_USABLE
    from nanorocks_ros.studies.analysis.results.results_folder import (
        check_results_folder,
        write_results,
    )
    from nanorocks_ros.studies.analysis.results.results_json import as_json

    source = Path(options.bags[0])
    folder = Path(options.output or f'{_stem(Path(options.named[0]))}_results')
    settings, notices, _ = bag_settings(options, source)
    scratch = _scratch_folder() if options.no_output else check_results_folder(folder)
    with Progress('analysing') as progress:
        analysis = analyse(
            source,
            settings,
            image_topic=options.image_topic,
            progress=progress.count,
            scratch=scratch,
        )
    analysis.notices += notices
    error: NanorocksError | None = analysis.error
    written = ''
    if not options.no_output:
        # Files first: the reader of a pipe may close it while this prints.
        try:
            write_results(analysis, folder, source, settings, options.format)
            written = f'nanorocks: results in {folder}'
        except NanorocksError as unwritten:
            error = unwritten
    print_notices(analysis.notices, options)
    if options.json:
        values = about_own_recording(as_json(analysis), options)
        print(json.dumps(values, allow_nan=False))
    else:
        _print(analysis, options)
    if written:
        print(written, file=sys.stderr)
    if error is not None:
        raise error
    return 0 if analysis.usable else EXIT_NOT_USABLE


def _stem(named: Path) -> Path:
    """What the results of a recording are named after; of a video without its ending."""
    from nanorocks_ros.recordings.film.video_streams import VIDEO_SUFFIXES

    # `.` and `..` have no name of a folder.
    resolved = named if named.name not in ('', '..') else named.resolve()
    return resolved.with_suffix('') if resolved.suffix in VIDEO_SUFFIXES else resolved


def _scratch_folder() -> Path | None:
    """Folder for records during the analysis; None (memory) where the system has none."""
    try:
        return Path(gettempdir())
    except OSError:
        return None


def _print(analysis: Analysis, options: argparse.Namespace) -> None:
    from nanorocks_ros.studies.analysis.results.tray_words import tray_lines

    lost = f', {analysis.frames_lost} lost' if analysis.frames_lost else ''
    print(f'{analysis.frames} frames{lost}, {analysis.seconds:.1f} s')
    for number, results in analysis.trays.items():
        print(f'tray {number}: {len(results.speeds)} speeds')
        for line in tray_lines(analysis, results):
            print(f'  {with_own_files(line, options)}')
