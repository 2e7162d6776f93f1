"""``nanorocks sweep``: many simulated runs at one point or over a grid of settings."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.settings import SimulationSettings, rows

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.settings import Scalar, SettingRow
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
    from nanorocks_ros.studies.sweeps.sweep_plan import SweepPlan
    from nanorocks_ros.studies.sweeps.sweep_result import Sweep

_MAX_VALUES = 10_000
_DIGITS = 12
# Settings of camera and shaking, which do not change a single decay.
_CAMERA = {
    'first_shake',
    'shake_period',
    'frame_rate',
    'width_px',
    'height_px',
    'pixels_per_metre',
    'noise',
}
_EPILOG = """\
A setting given as low:high:count or a,b,c is an axis of the grid; without an axis the sweep is a
single point. The same command resumes an interrupted sweep. Results do not depend on the number of
workers. Example:

  nanorocks sweep --restitution 0.5:0.95:10 --wall-restitution 0.8,0.9,0.99 --runs 178 -o out.npz
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_flags

    parser = commands.add_parser(
        'sweep',
        help='simulate many runs at one point or over a grid of settings',
        epilog=_EPILOG,
    )
    parser.add_argument('-o', '--output', required=True, help='.npz file to write')
    parser.add_argument('--runs', type=int, default=178, help='runs at each point; default 178')
    parser.add_argument(
        '--times', default='0:30:31', help='[s] times of the curves; default 0:30:31'
    )
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument(
        '--scheduler', metavar='tcp://HOST:PORT', help='scheduler of a Dask cluster'
    )
    parser.add_argument(
        '--task-seconds', type=float, default=1.0, help='[s] approximate work of a task; default 1'
    )
    parser.add_argument(
        '--common-random-numbers',
        action='store_true',
        help='run k has the same random numbers at every point',
    )
    parser.add_argument(
        '--keep-runs', action='store_true', help='keep the curves of all runs, not only means'
    )
    parser.add_argument('--csv', help='table of the curves to write, .csv')
    parser.add_argument('--figure', help='picture of the deviation from --reference over the grid')
    parser.add_argument(
        '--reference',
        help='point of the grid (A,B), .csv or .npz file of a decay, or folder of results',
    )
    parser.add_argument(
        '--free-speed',
        action='store_true',
        help='fit the initial speed of the reference, within a factor of 1.5 of the sweep',
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    add_flags(parser, SimulationSettings(), skip=_CAMERA)
    parser.leave_out('--times', '--scheduler', '--task-seconds', '--common-random-numbers')
    parser.leave_out('--keep-runs', '--reference', '--free-speed')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Sweep, write and print, and return the exit code."""
    from nanorocks_ros.cli.progress_bar import RunProgress
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.sweeps.sweep_runs import sweep

    plan = _plan(options)
    names = {'--csv': options.csv, '--figure': options.figure}
    files = {flag: Path(name) for flag, name in names.items() if name}
    check_outputs(files, {flag: (path.suffix,) for flag, path in files.items()}, force=True)
    workers = Workers(
        processes=options.workers,
        scheduler=options.scheduler,
        task_seconds=options.task_seconds,
    )
    # Checked before hours of work.
    reference = _reference(options, plan)
    output = Path(options.output)
    with RunProgress() as progress:
        result = sweep(plan, output, workers, progress.update, progress.notice)
    if options.csv:
        units = {row.name: row.unit for row in rows(SimulationSettings())}
        result.write_table(Path(options.csv), units)
    if options.figure:
        _draw(Path(options.figure), result, reference, options.free_speed)
    _print(options, result)
    return 0


def _plan(options: argparse.Namespace) -> SweepPlan:
    from nanorocks_ros.cli.flags import flag_of, settings_from
    from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan

    axes: dict[str, list[Scalar]] = {}
    for row in rows(SimulationSettings()):
        text = getattr(options, row.name, None)
        if isinstance(text, str) and not isinstance(row.default, tuple) and set(text) & set(':,'):
            axes[row.name] = values_of(text, flag_of(row.name), row)
            setattr(options, row.name, None)
    return sweep_plan(
        settings_from(options, SimulationSettings()),
        axes,
        [float(value) for value in values_of(options.times, '--times')],
        options.runs,
        common_random_numbers=options.common_random_numbers,
        keep_runs=options.keep_runs,
    )


def values_of(text: str, flag: str, row: SettingRow | None = None) -> list[Scalar]:
    """The values of an axis from its text.

    Parameters
    ----------
    text : str
        ``low:high:count``, both ends included, or ``a,b,c``.
    flag : str
        Flag, for the error.
    row : SettingRow, optional
        The setting of the axis; without it the values are numbers.

    Raises
    ------
    ConfigurationError
        For any other text.
    """
    form = 'give low:high:count or a,b,c'
    try:
        if ':' not in text:
            if row is not None and isinstance(row.default, str):
                return [part.strip() for part in text.split(',')]
            return [_number(part) for part in text.split(',')]
        low, high, count = text.split(':')
        number, start, end = int(count), float(low), float(high)
    except ValueError as error:
        raise ConfigurationError(flag, f'{text!r} cannot be read', form) from error
    if not (2 <= number <= _MAX_VALUES and start < end):
        raise ConfigurationError(
            flag, f'{text!r} has no values', f'{form} with low < high, 2 to {_MAX_VALUES} values'
        )
    step = (end - start) / (number - 1)
    values = [*(start + k * step for k in range(number - 1)), end]
    # 0.6, not 0.6000000000000001: --reference names the point by its value.
    return [_number(f'{value:.{_DIGITS}g}') for value in values]


def _number(text: str) -> int | float:
    try:
        return int(text)
    except ValueError:
        return float(text)


def _reference(options: argparse.Namespace, plan: SweepPlan) -> SpeedCurve | list[Scalar] | None:
    """The decay to compare with, or the point of the grid that is the reference."""
    from nanorocks_ros.studies.decays.cooling_curves import read_decay
    from nanorocks_ros.studies.decays.decay_curve import place_of

    if (options.figure is None) != (options.reference is None):
        raise ConfigurationError('--figure', 'needs --reference', 'give both or neither')
    if options.figure is None:
        return None
    from nanorocks_ros.studies.figures.sweep_figure import check_drawable

    check_drawable(Path(options.figure), plan.axes)
    path = Path(options.reference)
    if path.suffix in ('.csv', '.npz') or path.exists():
        return read_decay(path)
    point = _point(options.reference)
    place_of({axis.name: axis.values for axis in plan.axes}, point)
    return point


def _point(text: str) -> list[Scalar]:
    try:
        return [_number(part) for part in text.split(',')]
    except ValueError as error:
        raise ConfigurationError(
            '--reference', f'{text!r} cannot be read', 'give a point A,B or a .csv or .npz file'
        ) from error


def _draw(
    path: Path, result: Sweep, reference: SpeedCurve | list[Scalar] | None, scaled: bool
) -> None:
    from nanorocks_ros.studies.decays.decay_curve import curve_at
    from nanorocks_ros.studies.figures.sweep_figure import chi_square_figure

    if reference is not None:
        curve = curve_at(result, reference) if isinstance(reference, list) else reference
        chi_square_figure(path, result, curve, scaled=scaled)


def _print(options: argparse.Namespace, result: Sweep) -> None:
    points = result.mean_speed.size // result.times.size
    events = int(result.pair_collisions.sum() + result.wall_collisions.sum())
    if options.json:
        print(json.dumps({'output': options.output, 'events': events, **_as_json(result)}))
        return
    print(
        f'nanorocks: {result.runs} runs at each of {points} points, {events} events, in '
        f'{options.output}',
        file=sys.stderr,
    )


def _as_json(result: Sweep) -> dict[str, Any]:
    from nanorocks_ros.studies.sweeps.sweep_parts import COUNTS
    from nanorocks_ros.studies.sweeps.sweep_result import CURVES

    specification = json.loads(result.specification)
    curves = {name: getattr(result, name) for name in CURVES}
    return {
        'axes': {axis.name: list(axis.values) for axis in result.axes},
        'runs': result.runs,
        'seed': specification['settings']['seed'],
        'version': specification['version'],
        'time': result.times.tolist(),
        **{name: json_values(curve) for name, curve in curves.items()},
        **{name: getattr(result, name).tolist() for name in COUNTS},
    }
