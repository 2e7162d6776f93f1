"""``nanorocks simulate``: simulated runs of a tray that cools after a shaking event."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.tray_options import add_trays_file
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.settings import SceneFilmSettings, SimulationSettings

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.synthetic.simulated_files import SimulatedFiles
    from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRuns

_DURATION, _SAMPLES = 60.0, 301
# Of the JPEGs in a bag.
_QUALITY = 90
_CAMERA = 'width_px', 'height_px', 'pixels_per_metre'
_EPILOG = """\
The first run is filmed. Results do not depend on the number of workers. Examples:

  nanorocks simulate --tray 3 --runs 20 --picture tray_3.png
  nanorocks simulate --tray 1 --sticking-speed 0.002 --trajectory run.npz --video run.mp4
  nanorocks simulate --scene --duration 30 --bag scene
  nanorocks simulate --trays-file mine.yaml --tray 2 --runs 100 --json
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_flags

    parser = commands.add_parser(
        'simulate',
        help='simulate a tray that cools after a shaking event; write tables and films',
        epilog=_EPILOG,
    )
    _add_run_options(parser)
    _add_output_options(parser.add_argument_group('files to write, all optional'))
    add_flags(parser, SimulationSettings(), skip=set())
    add_flags(parser, SceneFilmSettings(), skip=set(), title='settings of --scene')
    parser.leave_out('--times', '--workers', '--trajectory', '--events', '--effects', '--quality')
    parser.leave_out('--force', '--json')
    parser.set_defaults(run=run)


def _add_run_options(parser: argparse.ArgumentParser) -> None:
    add_trays_file(parser)
    parser.add_argument('--runs', type=int, default=1, help='number of runs; default 1')
    parser.add_argument(
        '--duration',
        type=float,
        metavar='S',
        default=_DURATION,
        help='[s] simulated time after the shaking event; films have this length and begin '
        f'--first-shake before it; default {_DURATION:g}',
    )
    parser.add_argument(
        '--times',
        type=int,
        help='number of evenly spaced times from 0 to --duration, in the printed curves and in '
        f'trajectories; default: one for each frame, at most {_SAMPLES}',
    )
    parser.add_argument(
        '--scene',
        action='store_true',
        help='film the plate with all its trays through the lens of the flight camera, '
        'into --bag, --video or --picture (one .png or .jpg, at the end)',
    )
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')


def _add_output_options(group: Any) -> None:
    group.add_argument(
        '--trajectory',
        metavar='OUT.npz|.parquet',
        help='positions and velocities of all runs at all times; at most 1e8 numbers',
    )
    group.add_argument(
        '--events', metavar='OUT.npz|.parquet', help='every collision of all runs; at most 1.6e7'
    )
    group.add_argument(
        '--picture',
        metavar='OUT.png',
        help='picture of the beads at four times, and the decay; or .pdf, .svg',
    )
    group.add_argument(
        '--video',
        metavar='OUT.mp4|.avi',
        help='film of the first run, close to the tray unless the camera is set below; .mp4 '
        '(H.264) needs PyAV, .avi (Motion JPEG) needs nothing',
    )
    group.add_argument('--bag', help='rosbag2 folder with the film of the first run and the truth')
    group.add_argument(
        '--effects',
        choices=('all', 'none', 'drawn'),
        default='all',
        help='effects of the camera in bag and video; none: no sensor noise, and with --scene '
        'only shaded beads on a clean plate at rest; drawn: with --scene and one tray, a camera '
        'near to it, drawn at random by --seed; default all',
    )
    group.add_argument(
        '--quality',
        type=int,
        help=f'quality of the JPEGs in the bag, 1 to 100; default {_QUALITY}, or as drawn',
    )
    group.add_argument('--force', action='store_true', help='replace files (not bags) that exist')


def run(options: argparse.Namespace) -> int:
    """Simulate, write, film and print, and return the exit code."""
    from nanorocks_ros.cli.simulation.simulate_scene import check_no_scene_flags, film_scene

    if options.quality is None and options.effects != 'drawn':
        options.quality = _QUALITY
    if options.scene:
        return film_scene(options)
    check_no_scene_flags(options)
    return _run_tray(options)


def _run_tray(options: argparse.Namespace) -> int:
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.studies.synthetic.simulated_runs import simulate

    files = _files(options)
    plan = _plan(options, files)
    plan.check_size()
    files.check(plan)
    workers = Workers(processes=options.workers)
    written: list[str] = []
    filmed: dict[str, Any] = {}
    with interruption_says(lambda: _remaining_files(files, written)):
        with Progress('simulating') as bar:
            runs = simulate(plan, workers, bar.part)
        for path in files.write(runs):
            written.append(str(path))  # noqa: PERF401
        if files.video is not None:
            with Progress('filming the video') as bar:
                filmed.update(files.film_video(plan, bar.count))
            written.append(str(files.video))
        if files.bag is not None:
            with Progress('filming the bag') as bar:
                filmed.update(files.film_bag(plan, bar.count))
            written.append(str(files.bag))
    _print(options, files, runs, filmed)
    return 0


def _files(options: argparse.Namespace) -> SimulatedFiles:
    from nanorocks_ros.studies.synthetic.simulated_files import SimulatedFiles

    names = 'trajectory', 'events', 'picture', 'video', 'bag'
    paths = {name: getattr(options, name) for name in names}
    return SimulatedFiles(
        **{name: Path(path) for name, path in paths.items() if path is not None},
        effects=options.effects == 'all',
        near=all(getattr(options, name) is None for name in _CAMERA),
        quality=options.quality,
        force=options.force,
    )


def _plan(options: argparse.Namespace, files: SimulatedFiles) -> SimulationPlan:
    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.experiment.trays import load_trays, tray_by_number
    from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan, default_samples

    trays = load_trays(options.trays_file)
    if options.tray is None and len(trays) == 1:
        (options.tray,) = (str(number) for number in trays)
    settings = settings_from(options, SimulationSettings())
    if options.effects == 'none' and options.noise is not None and settings.noise > 0.0:
        raise ConfigurationError(
            '--effects', 'none means no noise, but --noise is above 0', 'give one of them'
        )
    samples = options.times
    if samples is None:
        samples = default_samples(settings, options.duration, _SAMPLES)
    return SimulationPlan(
        settings=settings,
        tray=tray_by_number(trays, settings.tray),
        trays_file=options.trays_file or '',
        duration=options.duration,
        samples=samples,
        runs=options.runs,
        trajectory=files.trajectory is not None,
        picture=files.picture is not None,
        events=files.events is not None,
    )


def _remaining_files(files: SimulatedFiles, written: list[str]) -> str:
    """Message about the files that an interruption leaves."""
    messages = []
    if written:
        messages.append(f'complete: {", ".join(written)}')
    if files.bag is not None and files.bag.exists():
        messages.append(f'{files.bag} can be read up to the last frame written')
    return '; '.join(messages) or 'nothing was written'


def _print(
    options: argparse.Namespace,
    files: SimulatedFiles,
    runs: SimulatedRuns,
    filmed: dict[str, Any],
) -> None:
    from nanorocks_ros.cli.simulation.simulate_report import as_json, as_table

    if options.json:
        names = {flag.removeprefix('--'): str(path) for flag, path in files.named.items()}
        bag = {'bag': options.bag} if options.bag else {}
        printed = {**as_json(runs), **filmed, **bag, 'files': names}
        print(json.dumps(printed, allow_nan=False))
    else:
        print(as_table(runs, [str(path) for path in files.named.values()]))
