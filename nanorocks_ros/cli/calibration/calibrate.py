"""``nanorocks calibrate RECORDING``: lens and tray regions from the edges of the trays.

Tested by ``test/studies/calibration/test_camera_calibration.py``.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.imported_films import accept_films
from nanorocks_ros.cli.parsing.tray_options import add_trays, add_trays_file
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.json_values import finite_or_none

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.experiment.calibration import Calibration
    from nanorocks_ros.studies.calibration.plate_fit import PlateFit


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'calibrate', help='estimate lens and tray regions from a recording of the trays'
    )
    parser.add_argument('recording', help='rosbag2 folder, .mcap file, video or folder of images')
    accept_films(parser, 'recording')
    parser.add_argument('-o', '--output', help='calibration file to write, YAML')
    parser.add_argument('--picture', help='picture of the calibration to write, .png or .jpg')
    parser.add_argument(
        '--show', metavar='YAML', help='show this calibration instead of estimating one'
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument(
        '--image-topic', default='', help='camera topic; default: that of our nodes'
    )
    add_trays(parser, 'trays on the plate; default: all')
    add_trays_file(parser)
    parser.add_argument(
        '--scale',
        type=float,
        nargs=2,
        metavar=('LOW', 'HIGH'),
        help='bounds of the scale [px/m]; default: the plate fills the frame',
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Calibrate or show, print and write, and return the exit code."""
    from nanorocks_ros.experiment.calibration_file import load_calibration, write_calibration
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.outputs.photographs import write_photograph
    from nanorocks_ros.studies.analysis.bag_frames import BagFrames
    from nanorocks_ros.studies.calibration.camera_calibration import (
        calibrate,
        draw_calibration,
        median_image,
    )

    _check_options(options)
    names = {'--output': options.output, '--picture': options.picture}
    files = {flag: Path(name) for flag, name in names.items() if name}
    # Calibrations are made anew over the old ones, whatever their names end in.
    check_outputs(files, {flag: (path.suffix,) for flag, path in files.items()}, force=True)
    flown = load_trays(options.trays_file)
    numbers = options.trays or sorted(flown)
    trays = [tray_by_number(flown, number) for number in dict.fromkeys(numbers)]
    fit = None
    if options.show:
        calibration = load_calibration(options.show)
        picture = median_image(BagFrames(options.recording, options.image_topic))
        _check_size(options.show, calibration, picture.shape)
    else:
        for tray in trays:
            if tray.place is None:
                raise ConfigurationError(
                    f'tray {tray.number}',
                    'has no position on the plate',
                    'leave it out of --trays',
                )
        frames = BagFrames(options.recording, options.image_topic)
        scale = tuple(options.scale) if options.scale else None
        fit, picture = calibrate(frames, trays, scale)
        calibration = fit.calibration
    if options.output:
        remark = f'nanorocks calibrate, from {Path(options.recording).name}'
        write_calibration(calibration, Path(options.output), remark)
    if options.picture:
        write_photograph(Path(options.picture), draw_calibration(picture, calibration))
    if options.json:
        print(json.dumps(as_json(calibration, fit), allow_nan=False))
    else:
        _print(calibration, fit, options)
    return 0


def _check_options(options: argparse.Namespace) -> None:
    if options.show and options.output:
        raise ConfigurationError('--show', 'cannot be used with --output', 'give one of them')
    low, high = options.scale or (1.0, 2.0)
    if not (math.isfinite(high) and 0.0 < low < high):
        raise ConfigurationError(
            '--scale', f'{low:g} to {high:g}', 'give a lower and a higher bound'
        )


def _check_size(path: str, calibration: Calibration, shape: tuple[int, ...]) -> None:
    info = calibration.info
    if (info.height, info.width) != shape[:2]:
        raise ConfigurationError(
            path,
            f'is for {info.width}x{info.height} px, the recording has {shape[1]}x{shape[0]} px',
            'calibrate this recording',
        )


def as_json(calibration: Calibration, fit: PlateFit | None) -> dict[str, Any]:
    """The calibration as values for JSON; None where unknown."""
    from nanorocks_ros.studies.calibration.camera_calibration import max_distortion_px

    residual = calibration.residual_px
    info = calibration.info
    values: dict[str, Any] = {
        'width': info.width,
        'height': info.height,
        'distortion_model': info.distortion_model,
        'd': list(info.d),
        'k': list(info.k),
        'r': list(info.r),
        'p': list(info.p),
        'pixels_per_metre': calibration.pixels_per_metre,
        'residual_px': finite_or_none(residual),
        'largest_bend_px': max_distortion_px(calibration),
        'trays': {str(number): list(region) for number, region in calibration.regions.items()},
    }
    if fit is not None:
        values['edges'] = len(fit.residuals)
        values['camera_pixels_per_metre'] = {str(k): scale for k, scale in fit.tray_scales.items()}
    return values


def _print(calibration: Calibration, fit: PlateFit | None, options: argparse.Namespace) -> None:
    from nanorocks_ros.studies.calibration.camera_calibration import max_distortion_px

    info = calibration.info
    print(f'{info.width}x{info.height} px, {info.distortion_model}')
    print(f'focal length {info.k[0]:.1f} px, axis at {info.k[2]:.1f}, {info.k[5]:.1f} px')
    print(f'distortion {", ".join(f"{coefficient:.4f}" for coefficient in info.d)}')
    print(
        f'the lens moves the corners of the trays by up to {max_distortion_px(calibration):.1f} px'
    )
    print(f'scale {calibration.pixels_per_metre:.0f} px/m in the rectified picture')
    if not math.isnan(calibration.residual_px):
        edges = '' if fit is None else f' ({len(fit.residuals)} points on edges)'
        print(f'residual {calibration.residual_px:.3f} px rms{edges}')
    for number, region in sorted(calibration.regions.items()):
        tray_scale = (
            '' if fit is None else f', {fit.tray_scales[number] / 1e3:.2f} px/mm in the frame'
        )
        x, y, width, height = region
        print(f'tray {number}: x={x} y={y}, {width}x{height} px{tray_scale}')
    for name in ('output', 'picture'):
        if getattr(options, name):
            print(f'written: {getattr(options, name)}')
