"""``nanorocks info BAG``: what a bag holds, and whether it is well."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nanorocks_ros.studies.inspection.bag_info import BagInfo, TopicReport

_MB = 1e6
NS = 1_000_000_000


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser('info', help='say what a bag holds, and whether it is well')
    parser.add_argument('bag', help='rosbag2 folder, .mcap or .db3 file')
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read the bag, print; the exit code."""
    from nanorocks_ros.cli.progress import Progress
    from nanorocks_ros.studies.inspection.bag_info import bag_info

    with Progress('reading') as progress:
        info = bag_info(Path(options.bag), progress.count)
    if options.json:
        print(json.dumps(_as_json(info), allow_nan=False))
    else:
        _print(info)
    return 0


def _as_json(found: BagInfo) -> dict[str, Any]:
    lens = found.calibration
    return {
        'topics': [_topic_as_json(report) for report in found.topics.values()],
        'duration': found.duration,
        'complete': found.complete,
        'start': found.start_ns / NS,
        'end': found.end_ns / NS,
        'messages_lost': found.messages_lost,
        'size': found.size,
        'trays': found.trays,
        'camera': found.camera or None,
        'pictures': found.pictures or None,
        'calibration': None
        if lens is None
        else {
            'width': lens.width,
            'height': lens.height,
            'distortion_model': lens.distortion_model,
            'd': list(lens.d),
            'k': list(lens.k),
        },
        'metadata': found.metadata,
        'health': [{'what': ailment.what, 'remedy': ailment.remedy} for ailment in found.health],
    }


def _topic_as_json(one: TopicReport) -> dict[str, Any]:
    stamps = one.stamps_ns
    return {
        'name': one.info.name,
        'type': one.info.type,
        'count': len(stamps),
        'rate': one.rate,
        'gaps': one.gaps,
        'longest_gap': one.longest_gap,
        'first': stamps[0] / NS if stamps else None,
        'last': stamps[-1] / NS if stamps else None,
    }


def _print(found: BagInfo) -> None:
    from nanorocks_ros.recordings.messages.iso8601 import instant_text

    state = 'complete' if found.complete else 'NOT complete'
    print(f'{_shown(str(found.path))}: {found.duration:.3f} s, {found.size / _MB:.1f} MB, {state}')
    if found.topics:
        print(f'from {instant_text(found.start_ns)} to {instant_text(found.end_ns)}')
    for report in found.topics.values():
        rate = f', {report.rate:.4g} Hz' if report.rate else ''
        gaps = f', {report.gaps} gaps of up to {report.longest_gap:.2f} s' if report.gaps else ''
        name, kind = _shown(report.info.name), _shown(report.info.type)
        print(f'  {name} [{kind}]: {len(report.stamps_ns)}{rate}{gaps}')
    if found.pictures:
        print(f'pictures: {_shown(found.pictures)}')
    if found.trays:
        print(f'trays: {", ".join(str(tray) for tray in found.trays)}')
    if found.calibration is not None:
        lens = found.calibration
        print(f'calibration: {lens.distortion_model}, {lens.width}x{lens.height} px')
    for key, value in found.metadata.items():
        print(f'  {_shown(key)}: {_shown(value)}')
    for ailment in found.health:
        print(f'{_shown(ailment.what)}; {_shown(ailment.remedy)}')
    if not found.health:
        print('nothing is wrong with it')


def _shown(text: str) -> str:
    """The text in one line; a terminal must not obey what a stranger wrote into a bag."""
    return ''.join(one if one.isprintable() else repr(one)[1:-1] for one in text)
