"""``nanorocks import VIDEO... -o BAG``: import videos and folders of images into bags.

Tested by ``test/cli/recordings/test_recordings.py``.
"""

from __future__ import annotations

import argparse
import json
import sys
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.flags import SHORT_FLAGS, add_flag, settings_from
from nanorocks_ros.cli.notices import tell
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.settings import PipelineSettings, rows

if TYPE_CHECKING:
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
    from nanorocks_ros.studies.film_import.import_each import ImportBatch
    from nanorocks_ros.studies.film_import.import_result import ImportResult

# Settings of the pipeline that describe what a film shows.
_EXPERIMENT = (
    'trays',
    'trays_file',
    'preprocess.layout',
    'preprocess.pixels_per_metre',
    'preprocess.regions_px',
)
# Number of skipped files that are named in the notice.
_NAMED = 3


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser('import', help='import videos or folders of images into bags')
    parser.add_argument(
        'videos',
        nargs='+',
        metavar='VIDEO',
        help='video or folder of images; several are parts of one recording, in order of time',
    )
    parser.add_argument(
        '-o', '--output', required=True, help='new bag; with --each the folder of the bags'
    )
    parser.add_argument(
        '--each',
        action='store_true',
        help='make a bag of each video, also of those in folders; complete bags are kept',
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument(
        '--start', help='time of the first frame, ISO 8601; UTC unless it has a time zone'
    )
    parser.add_argument(
        '--rate', help='frames per second of the camera; default: as stated in the video'
    )
    parser.add_argument(
        '--calibration', metavar='YAML', help='calibration file, for the camera_info in the bag'
    )
    _add_experiment(parser.add_argument_group('what the film shows, kept in the bag'))
    parser.add_argument(
        '--quality',
        type=int,
        default=95,
        help='JPEG quality of frames that are not JPEG already, 1 to 100; default 95',
    )
    parser.leave_out('--quality', '--preprocess-regions-px', '--preprocess-layout')
    parser.set_defaults(run=run)


def _add_experiment(group: Any) -> None:
    """Flags of `nanorocks analyse`, which then needs them no more."""
    by_name = {row.name: row for row in rows(PipelineSettings())}
    for name in _EXPERIMENT:
        add_flag(group, by_name[name], 'not stated')


def run(options: argparse.Namespace) -> int:
    """Import the videos and print the result; returns the exit code."""
    settings = _settings(options)
    paths, output = [Path(video) for video in options.videos], Path(options.output)
    return (_run_each if options.each else _run_single)(options, settings, paths, output)


def _settings(options: argparse.Namespace) -> ImportSettings:
    from nanorocks_ros.experiment.calibration_file import load_calibration
    from nanorocks_ros.recordings.messages.iso8601 import parse_iso8601
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings

    start_ns = parse_iso8601(options.start) if options.start else None
    if options.start and start_ns is None:
        raise ConfigurationError(
            '--start',
            f'{options.start!r} is not an ISO 8601 time',
            'give one like 2024-01-31T12:34:56Z',
        )
    try:
        rate = Fraction(options.rate) if options.rate else None
    except (ValueError, ZeroDivisionError) as error:
        raise ConfigurationError(
            '--rate', f'{options.rate!r} is not a number', 'give one like 30 or 30000/1001'
        ) from error
    name = options.calibration
    experiment = _experiment(options)
    return ImportSettings(
        quality=options.quality,
        start_ns=start_ns,
        rate=rate,
        calibration=load_calibration(name) if name else None,
        calibration_name=name or '',
        experiment=experiment,
    )


def _experiment(options: argparse.Namespace) -> dict[str, str]:
    """What the bag is to say of its trays, checked."""
    from nanorocks_ros.experiment.recorded_experiment import experiment_metadata
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number

    told = {name for name in _EXPERIMENT if getattr(options, name) is not None}
    settings = settings_from(options, PipelineSettings())
    values: dict[str, Any] = {row.name: row.default for row in rows(settings) if row.name in told}
    if options.calibration:
        values['preprocess.calibration'] = options.calibration
        for name in told - {'trays', 'trays_file'}:
            raise ConfigurationError(
                SHORT_FLAGS[name], 'is part of the --calibration', 'leave out one of them'
            )
    trays = load_trays(settings.trays_file)
    for number in values.get('trays', ()):
        tray_by_number(trays, number)
    regions = values.get('preprocess.regions_px', ())
    if regions and len(regions) != 4 * len(values.get('trays', ())):
        raise ConfigurationError(
            '--regions-px',
            f'{len(regions)} numbers for {len(values.get("trays", ()))} trays',
            'give x, y, width, height for each of --trays',
        )
    return experiment_metadata(values)


def _run_single(
    options: argparse.Namespace, settings: ImportSettings, paths: list[Path], output: Path
) -> int:
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.outputs.atomic_files import check_new_folder
    from nanorocks_ros.studies.film_import.import_film import import_films

    check_new_folder(output.parent)
    with Progress('importing') as progress:
        imported = import_films(paths, output, settings, progress.part)
    _print_notices(imported)
    print(json.dumps(_as_json(imported)) if options.json else _text(imported))
    return 0


def _run_each(
    options: argparse.Namespace, settings: ImportSettings, paths: list[Path], output: Path
) -> int:
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.outputs.atomic_files import check_new_folder
    from nanorocks_ros.studies.film_import.find_films import find_films
    from nanorocks_ros.studies.film_import.import_each import import_each

    check_new_folder(output)
    with Progress('importing') as progress:
        search = find_films(paths)
        with interruption_says('run the same command again to import the remaining videos'):
            batch = import_each(
                search.films, output, settings, lambda done, _: progress.part(done)
            )
    batch.failed = search.failed | batch.failed
    for imported in batch.imported:
        _print_notices(imported)
    if options.json:
        print(json.dumps(_batch_as_json(batch, search.left_out)))
    else:
        for imported in batch.imported:
            print(_text(imported))
        print(f'{len(batch.imported)} imported, {len(batch.skipped)} existed already')
    _print_left_out(search.left_out)
    return _print_failures(batch)


def _print_notices(imported: ImportResult) -> None:

    for notice in imported.notices:
        tell(notice)


def _print_left_out(files: list[Path]) -> None:
    if not files:
        return
    from nanorocks_ros.outputs.safe_text import counted, printable

    names = [*(printable(file.name) for file in files[:_NAMED]), *['...'] * (len(files) > _NAMED)]
    print(
        f'nanorocks: skipped {counted(len(files), "file")} without a supported video extension '
        f'({", ".join(names)}); name a file to import it anyway',
        file=sys.stderr,
    )


def _print_failures(batch: ImportBatch) -> int:
    """Print the errors of a batch; returns the exit code."""
    if not batch.failed:
        return 0

    for error in batch.failed.values():
        tell(str(error))
    total = len(batch.failed) + len(batch.imported) + len(batch.skipped)
    print(
        f'nanorocks: {len(batch.failed)} of {total} videos could not be imported, see above; '
        'run the same command again to retry',
        file=sys.stderr,
    )
    return 1


def _text(imported: ImportResult) -> str:
    from nanorocks_ros.outputs.safe_text import counted, printable

    dropped = imported.duplicates_dropped
    repeats = f', {counted(dropped, "duplicate")} dropped' if dropped else ''
    return (
        f'{printable(imported.bag)}: {counted(imported.frames, "frame")}, '
        f'{imported.duration:.3f} s'
        f'{repeats}, '
        f'{imported.provenance["pictures"]}'
    )


def _as_json(imported: ImportResult) -> dict[str, Any]:
    from nanorocks_ros.records import NS

    return {
        'frames': imported.frames,
        'duplicates_dropped': imported.duplicates_dropped,
        'duration': imported.duration,
        'bag': str(imported.bag),
        'start': imported.start_ns / NS,
        'frames_damaged': imported.damaged,
        'pictures': imported.provenance['pictures'],
        'notices': imported.notices,
    }


def _batch_as_json(batch: ImportBatch, left_out: list[Path]) -> dict[str, Any]:
    return {
        'frames': sum(imported.frames for imported in batch.imported),
        'duplicates_dropped': sum(imported.duplicates_dropped for imported in batch.imported),
        'duration': sum(imported.duration for imported in batch.imported),
        'bag': str(batch.folder),
        'imported': [_as_json(imported) for imported in batch.imported],
        'skipped': [str(path) for path in batch.skipped],
        'left_out': [str(path) for path in left_out],
        'failed': [
            {'video': str(film), 'reason': str(error)} for film, error in batch.failed.items()
        ],
    }
