"""``nanorocks track BAG``: every bead of a recording, followed through it."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.settings import PipelineSettings

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.calibration.track_comparison import TrackComparison

_MM = 1e3
_PERCENT = 100.0


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser('track', help='follow every bead through a bag')
    add_bag(parser)
    parser.add_argument('-o', '--output', help='table of the tracks to write, .csv or .parquet')
    parser.add_argument('--picture', help='picture of the last frame with tracks to write, .png')
    parser.add_argument(
        '--compare',
        metavar='FILE',
        help='tracks made by hand: CSV (frame, id, x, y), TrackMate CSV or XML, NASA Spotlight',
    )
    parser.add_argument(
        '--first-frame', type=int, default=0, help='number of the first frame in FILE; default 0'
    )
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Track, print, write; the exit code."""
    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.cli.progress import Progress
    from nanorocks_ros.studies.analysis.bag_tracks import track_bag
    from nanorocks_ros.studies.calibration.manual_tracks import read_manual_tracks

    settings = settings_from(options, PipelineSettings(), options.parameters)
    _check_outputs(options)
    manual = read_manual_tracks(options.compare) if options.compare else None
    with Progress('tracking') as progress:
        bag = track_bag(
            Path(options.bag), settings, image_topic=options.image_topic, progress=progress.count
        )
    for notice in bag.notices:
        print(f'nanorocks: {notice}', file=sys.stderr)
    compared = {} if manual is None else _compared(bag, manual, options.first_frame)
    if options.json:
        print(json.dumps(_as_json(bag, compared), allow_nan=False))
    else:
        _print(bag, compared)
    _write(options, bag)
    return 0


def _check_outputs(options: argparse.Namespace) -> None:
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.outputs.parquet import check_parquet
    from nanorocks_ros.studies.analysis.tracks_files import TABLES

    named = {'--output': options.output, '--picture': options.picture}
    files = {flag: Path(name) for flag, name in named.items() if name}
    check_outputs(files, {'--output': TABLES, '--picture': ('.png',)}, force=options.force)
    if options.output:
        check_parquet(Path(options.output))


def _write(options: argparse.Namespace, found: TrackedBag) -> None:
    from nanorocks_ros.studies.analysis.tracks_files import write_tracks
    from nanorocks_ros.studies.inspection.track_overlay import overlay, write_overlay

    if options.output:
        write_tracks(Path(options.output), found)
        print(f'nanorocks: tracks in {options.output}', file=sys.stderr)
    if options.picture:
        pictures = [
            overlay(image, found.tracks[number], found.pixels_per_metre)
            for number, image in sorted(found.pictures.items())
        ]
        write_overlay(Path(options.picture), pictures)
        print(f'nanorocks: picture in {options.picture}', file=sys.stderr)


def _compared(found: TrackedBag, manual: Any, first_frame: int) -> dict[int, TrackComparison]:
    """The comparison for each tray in which the file has places."""
    from nanorocks_ros.errors import RecordingError
    from nanorocks_ros.studies.calibration.track_comparison import compare_tracks, manual_reference

    results = {}
    for number, tray in found.trays.items():
        reference = manual_reference(
            manual,
            found.tracks[number],
            found.numbers[number],
            region=found.regions[number],
            pixels_per_metre=found.pixels_per_metre,
            view=found.view,
            first_frame=first_frame,
        )
        if reference:
            reach = 0.5 * min(one.diameter_low for one in tray.species)
            results[number] = compare_tracks(found.tracks[number], reference, reach=reach)
    if not results:
        raise RecordingError(
            'the tracks made by hand',
            'lie in no tray and frame of the recording',
            'give places in pixels of its frames, and --first-frame',
        )
    return results


def _counts(found: TrackedBag, number: int) -> list[dict[str, Any]]:
    """What was seen of each species of a tray, on average over the frames."""
    rows = []
    for index, species in enumerate(found.trays[number].species):
        tracks = found.tracks[number]
        seen = sum(int((one.seen & (one.species == index)).sum()) for one in tracks)
        followed = sum(int((one.species == index).sum()) for one in tracks)
        numbers = {int(one) for record in tracks for one in record.ids[record.species == index]}
        rows.append(
            {
                'material': species.material,
                'expected': species.count,
                'seen': seen / max(len(tracks), 1),
                'followed': followed / max(len(tracks), 1),
                'tracks': len(numbers),
            }
        )
    return rows


def _as_json(found: TrackedBag, compared: dict[int, TrackComparison]) -> dict[str, Any]:
    return {
        'frames': found.frames,
        'trays': {
            str(number): {
                'frames': len(found.tracks[number]),
                'species': _counts(found, number),
                'comparison': _comparison_as_json(compared.get(number)),
            }
            for number in found.trays
        },
    }


def _comparison_as_json(found: TrackComparison | None) -> dict[str, Any] | None:
    if found is None:
        return None
    values: dict[str, Any] = {
        name: getattr(found, name)
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
    values['offset'] = list(found.offset)
    known: dict[str, Any] = json_values(values)
    if math.isnan(found.offset[0]):
        known['offset'] = None
    return known


def _print(found: TrackedBag, compared: dict[int, TrackComparison]) -> None:
    print(f'{found.frames} frames')
    for number in found.trays:
        print(f'tray {number}: {len(found.tracks[number])} frames tracked')
        for row in _counts(found, number):
            share = _PERCENT * row['seen'] / row['expected']
            print(
                f'  {row["material"]}: {row["seen"]:.1f} of {row["expected"]} seen '
                f'({share:.0f} %), {row["followed"]:.1f} followed, {row["tracks"]} tracks'
            )
        if number in compared:
            _print_comparison(compared[number])


def _print_comparison(one: TrackComparison) -> None:
    print(
        f'  by hand: {one.beads} beads, {_PERCENT * one.found:.1f} % of {one.places} places '
        f'found, rms distance {_MM * one.rms_distance:.3f} mm'
    )
    print(
        f'  {one.links_correct} of {one.links} links agree, {one.switches} identity switches, '
        f'speed over theirs {one.speed_ratio:.3f}'
    )
