"""``nanorocks info BAG``: topics, calibration, provenance and problems of a bag.

Tested by ``test/cli/recordings/test_recordings.py``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nanorocks_ros.studies.inspection.bag_info import BagInfo, TopicReport

_MB = 1e6


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.imported_films import accept_films

    parser = commands.add_parser('info', help='show the contents of a bag and its problems')
    parser.add_argument(
        'bag', help='rosbag2 folder, .mcap or .db3 file, video or folder of images'
    )
    accept_films(parser, 'bag')
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read the bag and print its contents; returns the exit code."""
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.studies.inspection.bag_info import bag_info

    with Progress('reading') as progress:
        info = bag_info(Path(options.bag), progress.count)
    if options.json:
        print(json.dumps(_as_json(info), allow_nan=False))
    else:
        _print(info)
    return 0


def _as_json(info: BagInfo) -> dict[str, Any]:
    from nanorocks_ros.records import NS

    lens = info.calibration
    return {
        'topics': [_topic_as_json(report) for report in info.topics.values()],
        'duration': info.duration,
        'complete': info.complete,
        'start': info.start_ns / NS,
        'end': info.end_ns / NS,
        'messages_lost': info.messages_lost,
        'size': info.size,
        'trays': info.trays,
        'camera': info.camera or None,
        'pictures': info.pictures or None,
        'calibration': None
        if lens is None
        else {
            'width': lens.width,
            'height': lens.height,
            'distortion_model': lens.distortion_model,
            'd': list(lens.d),
            'k': list(lens.k),
        },
        'metadata': info.metadata,
        'health': [{'what': problem.what, 'remedy': problem.remedy} for problem in info.health],
    }


def _topic_as_json(report: TopicReport) -> dict[str, Any]:
    from nanorocks_ros.records import NS

    stamps = report.stamps_ns
    return {
        'name': report.info.name,
        'type': report.info.type,
        'count': len(stamps),
        'rate': report.rate,
        'gaps': report.gaps,
        'longest_gap': report.longest_gap,
        'first': stamps[0] / NS if stamps else None,
        'last': stamps[-1] / NS if stamps else None,
    }


def _print(info: BagInfo) -> None:
    from nanorocks_ros.outputs.safe_text import counted
    from nanorocks_ros.recordings.messages.iso8601 import format_iso8601

    state = 'complete' if info.complete else 'NOT complete'
    print(f'{_shown(str(info.path))}: {info.duration:.3f} s, {info.size / _MB:.1f} MB, {state}')
    if info.topics:
        print(f'from {format_iso8601(info.start_ns)} to {format_iso8601(info.end_ns)}')
    for report in info.topics.values():
        rate = f', {report.rate:.4g} Hz' if report.rate else ''
        gaps = (
            f', {counted(report.gaps, "gap")} of up to {report.longest_gap:.2f} s'
            if report.gaps
            else ''
        )
        name, kind = _shown(report.info.name), _shown(report.info.type)
        print(f'  {name} [{kind}]: {len(report.stamps_ns)}{rate}{gaps}')
    if info.pictures:
        print(f'pictures: {_shown(info.pictures)}')
    if info.trays:
        print(f'trays: {", ".join(str(tray) for tray in info.trays)}')
    if info.calibration is not None:
        lens = info.calibration
        print(f'calibration: {lens.distortion_model}, {lens.width}x{lens.height} px')
    for key, value in info.metadata.items():
        print(f'  {_shown(key)}: {_shown(value)}')
    for problem in info.health:
        print(f'{_shown(problem.what)}; {_shown(problem.remedy)}')
    if not info.health:
        print('no problems info')


def _shown(text: str) -> str:
    """Escape line breaks and terminal control sequences in a text from a bag."""
    return ''.join(
        character if character.isprintable() else repr(character)[1:-1] for character in text
    )
