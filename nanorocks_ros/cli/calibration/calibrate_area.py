"""``nanorocks calibrate-area BAG TRACKS``: calibration of the binarised area by manual tracks.

Tested by ``test/studies/calibration/test_area_calibration.py``.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.outputs.json_values import finite_or_none

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.calibration.area_calibration import AreaCalibration
    from nanorocks_ros.studies.calibration.area_fit import AreaFit

_MM, _PERCENT = 1e3, 100.0
_KINDS = {'--output': ('.yaml', '.yml'), '--picture': ('.png',)}


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser(
        'calibrate-area', help='calibrate the binarised area by manual tracks'
    )
    add_bag(parser, skip={'speed.method', 'speed.area_factor', 'speed.area_offset'})
    parser.add_argument(
        'tracks',
        help='manual tracks: CSV (frame, id, x, y), TrackMate CSV or XML, NASA Spotlight',
    )
    parser.add_argument(
        '--first-frame', type=int, default=0, help='number of the first frame in TRACKS; default 0'
    )
    parser.add_argument(
        '-o',
        '--output',
        help='parameter file to write, .yaml; one for each tray with tracks',
    )
    parser.add_argument('--picture', help='picture of measured and manual speeds to write, .png')
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Fit, print and write, and return the exit code."""
    from nanorocks_ros.cli.flags import bag_settings, settings_from
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.calibration.area_calibration import calibrate_area
    from nanorocks_ros.studies.calibration.manual_tracks import read_manual_tracks

    _check_outputs(options, settings_from(options, PipelineSettings(), options.parameters))
    settings, assumed, _ = bag_settings(options, options.bag)
    _check_outputs(options, settings)
    manual = read_manual_tracks(options.tracks)
    with interruption_says('nothing was written'), Progress('measuring') as progress:
        calibration = calibrate_area(
            Path(options.bag),
            manual,
            settings,
            first_frame=options.first_frame,
            image_topic=options.image_topic,
            progress=progress.count,
        )
    refused = (str(error) for error in calibration.refused.values())
    print_notices((*assumed, *calibration.notices, *refused), options)
    if options.json:
        print(json.dumps(_as_json(calibration), allow_nan=False))
    else:
        _print(calibration)
    _write(options, calibration, settings)
    return 0


def _files(options: argparse.Namespace, trays: tuple[int, ...]) -> dict[int, Path]:
    """The parameter file of each tray."""
    path = Path(options.output)
    if len(trays) == 1:
        return {trays[0]: path}
    return {number: path.with_name(f'{path.stem}_tray_{number}{path.suffix}') for number in trays}


def _check_outputs(options: argparse.Namespace, settings: PipelineSettings) -> None:
    from nanorocks_ros.outputs.atomic_files import check_outputs

    names = {'--output': options.output, '--picture': options.picture}
    check_outputs(
        {flag: Path(name) for flag, name in names.items() if name}, _KINDS, force=options.force
    )
    if options.output:
        for path in _files(options, settings.trays).values():
            check_outputs({'--output': path}, _KINDS, force=options.force)


def _write(
    options: argparse.Namespace, calibration: AreaCalibration, settings: PipelineSettings
) -> None:
    if options.output:
        from nanorocks_ros.studies.calibration.area_file import write_parameters

        files = _files(options, settings.trays)
        for number, fit in calibration.fits.items():
            source = f'{Path(options.bag).name} and {Path(options.tracks).name}'
            write_parameters(files[number], fit, settings, f'tray {number}, {source}')
            print(f'nanorocks: parameters of tray {number} in {files[number]}', file=sys.stderr)
    if options.picture:
        from nanorocks_ros.studies.calibration.area_calibration_figure import (
            area_calibration_figure,
        )

        area_calibration_figure(Path(options.picture), calibration.fits)
        print(f'nanorocks: picture in {options.picture}', file=sys.stderr)


def _as_json(calibration: AreaCalibration) -> dict[str, Any]:
    return {
        'trays': {str(number): _fit_as_json(fit) for number, fit in calibration.fits.items()},
        'refused': {str(number): str(error) for number, error in calibration.refused.items()},
    }


def _fit_as_json(fit: AreaFit) -> dict[str, Any]:
    return {
        'area_factor': fit.factor,
        'area_factor_error': fit.factor_error,
        'area_offset': fit.offset,
        'area_offset_error': finite_or_none(fit.offset_error),
        'windows': fit.windows,
        'slowest': fit.slowest,
        'fastest': fit.fastest,
        'reduced_chi_square': fit.reduced_chi_square,
        'scatter': fit.scatter,
    }


def _print(calibration: AreaCalibration) -> None:
    for number, fit in calibration.fits.items():
        print(
            f'tray {number}: {fit.windows} windows, manual speeds {_MM * fit.slowest:.2f} to '
            f'{_MM * fit.fastest:.2f} mm/s'
        )
        print(f'  --speed-area-factor {fit.factor:.4g}   (+- {fit.factor_error:.2g})')
        if math.isfinite(fit.offset_error):
            print(f'  --speed-area-offset {fit.offset:.4g}   (+- {fit.offset_error:.2g} m/s)')
        else:
            print('  no offset: the range of speeds is too small to separate it from the factor')
        print(
            f'  calibrated speeds scatter by {_PERCENT * fit.scatter:.0f} % about manual speeds; '
            f'reduced chi square {fit.reduced_chi_square:.2f}'
        )
