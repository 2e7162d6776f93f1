"""``nanorocks track BAG``: tracks of all beads of a recording.

Tested by ``test/studies/analysis/test_bag_tracks.py``.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.json_values import json_values

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.calibration.track_comparison import TrackComparison

_MM = 1e3
_PERCENT = 100.0


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.films.film_options import add_film_options, leave_out_film_options
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser('track', help='track all beads of a film or bag')
    add_bag(parser)
    add_film_options(parser)
    parser.add_argument('-o', '--output', help='table of the tracks to write, .csv or .parquet')
    parser.add_argument(
        '--picture', help='picture of the last frame with tracks to write, .png or .jpg'
    )
    parser.add_argument(
        '--compare',
        metavar='FILE',
        help='manual tracks: CSV (frame, id, x, y), TrackMate CSV or XML, NASA Spotlight',
    )
    parser.add_argument(
        '--first-frame', type=int, default=0, help='number of the first frame in FILE; default 0'
    )
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    leave_out_film_options(parser)
    parser.leave_out('--compare', '--first-frame', '--force')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Track, print and write, and return the exit code."""
    from nanorocks_ros.cli.films.film_options import use_described_film
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.studies.analysis.recognition_verdicts import EXIT_NOT_USABLE
    from nanorocks_ros.studies.calibration.manual_tracks import read_manual_tracks

    _check_outputs(options)
    manual = read_manual_tracks(options.compare) if options.compare else None
    print_notices(use_described_film(options, Path(options.bag)), options)
    bag = tracked_bag(options)
    compared = {} if manual is None else _comparisons(bag, manual, options.first_frame)
    if options.json:
        from nanorocks_ros.cli.remedies import about_own_recording

        values = about_own_recording(_as_json(bag, compared), options)
        print(json.dumps(values, allow_nan=False))
    else:
        _print(bag, compared, options)
    _write(options, bag)
    return 0 if bag.usable else EXIT_NOT_USABLE


def tracked_bag(options: argparse.Namespace) -> TrackedBag:
    """Track the beads of the bag of the options, with progress; print what is to be known."""
    from nanorocks_ros.cli.flags import bag_settings
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.studies.analysis.bag_tracks import track_bag

    settings, assumed, _ = bag_settings(options, options.bag)
    with Progress('tracking') as progress:
        bag = track_bag(
            Path(options.bag), settings, image_topic=options.image_topic, progress=progress.count
        )
    print_notices((*assumed, *bag.notices), options)
    return bag


def _check_outputs(options: argparse.Namespace) -> None:
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.outputs.photographs import PHOTOGRAPHS
    from nanorocks_ros.outputs.tables.parquet import check_parquet
    from nanorocks_ros.studies.analysis.results.tracks_files import TABLES

    names = {'--output': options.output, '--picture': options.picture}
    files = {flag: Path(name) for flag, name in names.items() if name}
    check_outputs(files, {'--output': TABLES, '--picture': PHOTOGRAPHS}, force=options.force)
    if options.output:
        check_parquet(Path(options.output))


def _write(options: argparse.Namespace, bag: TrackedBag) -> None:
    from nanorocks_ros.studies.analysis.results.tracks_files import write_tracks
    from nanorocks_ros.studies.inspection.track_overlay import (
        MAGNIFICATION,
        overlay,
        with_scale_bar,
        write_overlay,
    )

    if options.output:
        write_tracks(Path(options.output), bag)
        print(f'nanorocks: tracks in {options.output}', file=sys.stderr)
    if options.picture:
        pictures = [
            with_scale_bar(
                overlay(image, bag.tracks[number], bag.pixels_per_metre),
                MAGNIFICATION * bag.pixels_per_metre,
            )
            for number, image in sorted(bag.pictures.items())
        ]
        write_overlay(Path(options.picture), pictures)
        print(f'nanorocks: picture in {options.picture}', file=sys.stderr)


def _comparisons(bag: TrackedBag, manual: Any, first_frame: int) -> dict[int, TrackComparison]:
    """The comparison for each tray in which the file has positions."""
    from nanorocks_ros.errors import RecordingError
    from nanorocks_ros.studies.calibration.track_comparison import compare_tracks, manual_reference

    comparisons = {}
    for number, tray in bag.trays.items():
        reference = manual_reference(
            manual,
            bag.tracks[number],
            bag.numbers[number],
            region=bag.regions[number],
            pixels_per_metre=bag.pixels_per_metre,
            view=bag.view,
            first_frame=first_frame,
        )
        if reference:
            reach = 0.5 * min(species.diameter_low for species in tray.species)
            comparisons[number] = compare_tracks(bag.tracks[number], reference, reach=reach)
    if not comparisons:
        raise RecordingError(
            'manual tracks',
            'lie in no tray and frame of the recording',
            'give positions in pixels of its frames, and --first-frame',
        )
    return comparisons


def _counts(bag: TrackedBag, number: int) -> list[dict[str, Any]]:
    """Beads seen and tracked of each species of a tray, mean over the frames."""
    rows = []
    for index, species in enumerate(bag.trays[number].species):
        tracks = bag.tracks[number]
        seen = sum(int((track.seen & (track.species == index)).sum()) for track in tracks)
        followed = sum(int((track.species == index).sum()) for track in tracks)
        identities = {
            int(track) for record in tracks for track in record.ids[record.species == index]
        }
        rows.append(
            {
                'material': species.material,
                'expected': species.expected,
                'seen': seen / max(len(tracks), 1),
                'followed': followed / max(len(tracks), 1),
                'tracks': len(identities),
            }
        )
    return rows


def _as_json(bag: TrackedBag, compared: dict[int, TrackComparison]) -> dict[str, Any]:
    from nanorocks_ros.studies.analysis.recognition_verdicts import verdict_as_json

    return {
        'frames': bag.frames,
        'trays': {
            str(number): {
                'frames': len(bag.tracks[number]),
                'species': _counts(bag, number),
                'recognition': [verdict_as_json(row) for row in bag.verdicts.get(number, ())],
                'comparison': _comparison_as_json(compared.get(number)),
            }
            for number in bag.trays
        },
    }


def _comparison_as_json(comparison: TrackComparison | None) -> dict[str, Any] | None:
    if comparison is None:
        return None
    values: dict[str, Any] = {
        name: getattr(comparison, name)
        for name in (
            'beads',
            'places',
            'found',
            'links',
            'links_correct',
            'switches',
            'switches_per_minute',
            'rms_distance',
            'speed_ratio',
        )
    }
    values['offset'] = list(comparison.offset)
    plain: dict[str, Any] = json_values(values)
    if math.isnan(comparison.offset[0]):
        plain['offset'] = None
    return plain


def _print(
    bag: TrackedBag, compared: dict[int, TrackComparison], options: argparse.Namespace
) -> None:
    from nanorocks_ros.cli.remedies import with_own_files

    print(f'{bag.frames} frames')
    for number in bag.trays:
        print(f'tray {number}: {len(bag.tracks[number])} frames tracked')
        for row in _counts(bag, number):
            print(f'  {row["material"]}: {_seen(row)}, {row["tracks"]} tracks')
        for verdict in bag.verdicts.get(number, ()):
            for line in verdict.lines():
                print(f'  {with_own_files(line, options)}')
        if number in compared:
            _print_comparison(compared[number])


def _seen(row: dict[str, Any]) -> str:
    """Beads seen and followed, with the share where their number is known."""
    followed = f'{row["followed"]:.1f} followed'
    if row['expected'] is None:
        return f'{row["seen"]:.1f} seen, {followed}'
    share = _PERCENT * row['seen'] / row['expected']
    return f'{row["seen"]:.1f} of {row["expected"]} seen ({share:.0f} %), {followed}'


def _print_comparison(comparison: TrackComparison) -> None:
    print(
        f'  manual: {comparison.beads} beads, {_PERCENT * comparison.found:.1f} % of '
        f'{comparison.places} positions found, rms distance {_MM * comparison.rms_distance:.3f} mm'
    )
    print(
        f'  {comparison.links_correct} of {comparison.links} links agree, '
        f'{comparison.switches} identity switches, '
        f'speed over manual speed {comparison.speed_ratio:.3f}'
    )
