"""``nanorocks import VIDEO... -o BAG``: videos and folders of images into bags."""

from __future__ import annotations

import argparse
import json
import sys
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
    from nanorocks_ros.studies.film_import.import_each import ImportedEach
    from nanorocks_ros.studies.film_import.import_film import Imported

# Of the files that were left out.
_NAMED = 3


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser('import', help='make bags of videos or folders of images')
    parser.add_argument(
        'videos',
        nargs='+',
        metavar='VIDEO',
        help='video or folder of images; several are parts of one recording, in order of time',
    )
    parser.add_argument(
        '-o', '--output', required=True, help='bag to make; with --each the folder of the bags'
    )
    parser.add_argument(
        '--each',
        action='store_true',
        help='a bag of each video; a folder stands for those in it; complete bags are left alone',
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument(
        '--start', help='when the first picture was taken, ISO 8601; UTC unless it says the zone'
    )
    parser.add_argument(
        '--rate', help='pictures per second that the camera took; default: as the video says'
    )
    parser.add_argument(
        '--calibration', metavar='YAML', help='calibration file, for the camera_info in the bag'
    )
    parser.add_argument(
        '--quality',
        type=int,
        default=95,
        help='of the JPEGs, 1 to 100, where pictures are not JPEG already; default 95',
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Import, print; the exit code."""
    settings = _settings(options)
    paths, output = [Path(video) for video in options.videos], Path(options.output)
    return (_run_each if options.each else _run_one)(options, settings, paths, output)


def _settings(options: argparse.Namespace) -> ImportSettings:
    from nanorocks_ros.experiment.calibration_file import load_calibration
    from nanorocks_ros.recordings.messages.iso8601 import instant
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings

    start_ns = instant(options.start) if options.start else None
    if options.start and start_ns is None:
        raise ConfigurationError(
            '--start', f'{options.start!r} is no instant', 'give one like 2024-01-31T12:34:56Z'
        )
    try:
        rate = Fraction(options.rate) if options.rate else None
    except (ValueError, ZeroDivisionError) as error:
        raise ConfigurationError(
            '--rate', f'{options.rate!r} is no rate', 'give one like 30 or 30000/1001'
        ) from error
    name = options.calibration
    return ImportSettings(
        quality=options.quality,
        start_ns=start_ns,
        rate=rate,
        calibration=load_calibration(name) if name else None,
        calibration_name=name or '',
    )


def _run_one(
    options: argparse.Namespace, settings: ImportSettings, paths: list[Path], output: Path
) -> int:
    from nanorocks_ros.cli.progress import Progress
    from nanorocks_ros.studies.film_import.import_film import as_json, import_films

    with Progress('importing') as progress:
        imported = import_films(paths, output, settings, progress.part)
    _tell(imported)
    print(json.dumps(as_json(imported)) if options.json else _text(imported))
    return 0


def _run_each(
    options: argparse.Namespace, settings: ImportSettings, paths: list[Path], output: Path
) -> int:
    from nanorocks_ros.cli.progress import Progress
    from nanorocks_ros.studies.film_import.find_films import films_of
    from nanorocks_ros.studies.film_import.import_each import import_each

    with Progress('importing') as progress:
        searched = films_of(paths)
        try:
            found = import_each(
                searched.films, output, settings, lambda done, _: progress.part(done)
            )
        except KeyboardInterrupt as interruption:
            raise KeyboardInterrupt('the same command goes on with what is left') from interruption
    found.failed = searched.failed | found.failed
    for imported in found.imported:
        _tell(imported)
    if options.json:
        print(json.dumps(_each_as_json(found, searched.left_out)))
    else:
        for imported in found.imported:
            print(_text(imported))
        print(f'{len(found.imported)} imported, {len(found.skipped)} were there already')
    _tell_left_out(searched.left_out)
    return _tell_failures(found)


def _tell(imported: Imported) -> None:
    from nanorocks_ros.outputs.safe_text import printable

    for notice in imported.notices:
        print(f'nanorocks: {printable(notice)}', file=sys.stderr)


def _tell_left_out(files: list[Path]) -> None:
    if not files:
        return
    from nanorocks_ros.outputs.safe_text import printable

    named = [*(printable(file.name) for file in files[:_NAMED]), *['...'] * (len(files) > _NAMED)]
    names = ', '.join(named)
    print(
        f'nanorocks: left out {len(files)} files that may be films or pictures of one, but not by '
        f'their names ({names}); pass those that are films by name',
        file=sys.stderr,
    )


def _tell_failures(found: ImportedEach) -> int:
    if not found.failed:
        return 0
    from nanorocks_ros.outputs.safe_text import printable

    for error in found.failed.values():
        print(f'nanorocks: {printable(str(error))}', file=sys.stderr)
    total = len(found.failed) + len(found.imported) + len(found.skipped)
    print(
        f'nanorocks: {len(found.failed)} of {total} videos could not be imported, listed above; '
        'the same command tries them again',
        file=sys.stderr,
    )
    return 1


def _text(imported: Imported) -> str:
    from nanorocks_ros.outputs.safe_text import printable

    dropped = imported.duplicates_dropped
    return (
        f'{printable(imported.bag)}: {imported.frames} frames, {imported.duration:.3f} s'
        f'{f", {dropped} duplicates dropped" if dropped else ""}, '
        f'{imported.provenance["pictures"]}'
    )


def _each_as_json(found: ImportedEach, left_out: list[Path]) -> dict[str, Any]:
    from nanorocks_ros.studies.film_import.import_film import as_json

    return {
        'frames': sum(one.frames for one in found.imported),
        'duplicates_dropped': sum(one.duplicates_dropped for one in found.imported),
        'duration': sum(one.duration for one in found.imported),
        'bag': str(found.folder),
        'imported': [as_json(one) for one in found.imported],
        'skipped': [str(path) for path in found.skipped],
        'left_out': [str(path) for path in left_out],
        'failed': [
            {'video': str(film), 'reason': str(error)} for film, error in found.failed.items()
        ],
    }
