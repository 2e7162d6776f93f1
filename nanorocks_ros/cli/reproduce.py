"""``nanorocks reproduce``: the figures and tables of the paper from simulated films.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan

_TEXT = 'simulate the campaign, analyse its films, and report every figure and table of the paper'
_EPILOG = """\
The report compares the values of the paper, its methods on our films, our methods on our films,
and the truth of the simulation. The same command resumes an interrupted run. Examples:

  nanorocks reproduce --quick -o reproduced
  nanorocks reproduce --cycles 18 --runs 178 -o campaign
"""
# Full campaign, and with --quick.
_RUNS, _CYCLES = (178, 10), (18, 1)
_MAX_STICKING_SPEED = 0.03
_POLL = 1.0


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'reproduce',
        help=_TEXT,
        description=_TEXT,
        epilog=_EPILOG,
    )
    parser.add_argument('-o', '--output', required=True, help='folder for films and report')
    parser.add_argument('--quick', action='store_true', help='one cycle of each kind, few runs')
    parser.add_argument(
        '--cycles', type=int, help='cycles of each kind; default 18, with --quick 1'
    )
    parser.add_argument(
        '--runs', type=int, help='runs at each point of a search; default 178, with --quick 10'
    )
    parser.add_argument('--seed', type=int, default=1, help='random seed; default 1')
    parser.add_argument(
        '--sticking-speed',
        type=float,
        default=3e-3,
        help='[m/s] speed below which beads stick; default 0.003',
    )
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Simulate, analyse and report, and return the exit code."""
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.studies.reproduction.reproduce_paper import minutes, reproduce
    from nanorocks_ros.studies.reproduction.simulated_campaign import parts_done

    plan, runs = _plan(options)
    workers = Workers(processes=options.workers)
    folder = Path(options.output)
    estimate = minutes(plan, workers.count)
    _notice(f'{2 * plan.cycles} films of the plate, about {estimate} minutes')
    with _Bars(lambda: parts_done(folder, plan)) as bars:
        path = reproduce(folder, plan, workers, runs, bars.progress, _notice)
    if options.json:
        print(json.dumps({'report': str(path), 'cycles': plan.cycles, 'runs': runs}))
    _notice(f'report in {path}')
    return 0


def _plan(options: argparse.Namespace) -> tuple[CampaignPlan, int]:
    from nanorocks_ros.errors import ConfigurationError
    from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan

    cycles, runs = (
        defaults[options.quick] if given is None else given
        for given, defaults in ((options.cycles, _CYCLES), (options.runs, _RUNS))
    )
    for flag, value, minimum in (('--cycles', cycles, 1), ('--runs', runs, 2)):
        if value < minimum:
            raise ConfigurationError(flag, f'{value}', f'give {minimum} or more')
    if options.seed < 0:
        raise ConfigurationError('--seed', f'{options.seed}', 'give 0 or more')
    if not 0.0 < options.sticking_speed <= _MAX_STICKING_SPEED:
        raise ConfigurationError(
            '--sticking-speed',
            f'{options.sticking_speed:g} m/s',
            f'give a speed above 0, up to {_MAX_STICKING_SPEED:g}',
        )
    plan = CampaignPlan(cycles=cycles, seed=options.seed, sticking_speed=options.sticking_speed)
    return plan, runs


class _Bars:
    """One bar after another; that of the films reads the progress files of their processes."""

    def __init__(self, films_done: Callable[[], float]) -> None:
        self._films_done = films_done
        self._bar: tuple[str, Progress] | None = None
        self._over = threading.Event()

    def __enter__(self) -> _Bars:
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()
        return self

    def progress(self, name: str, done: float) -> None:
        """Show the part of a chapter that is done, 0 to 1."""
        from nanorocks_ros.cli.progress_bar import Progress

        if self._bar is None or self._bar[0] != name:
            self._close()
            self._bar = name, Progress(name).__enter__()
        self._bar[1].part(done)

    def _watch(self) -> None:
        while not self._over.wait(_POLL):
            bar = self._bar
            if bar is not None and bar[0] == 'films':
                bar[1].part(self._films_done())

    def _close(self) -> None:
        if self._bar is not None:
            self._bar[1].__exit__()

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._watcher.join()
        self._close()


def _notice(text: str) -> None:
    tell(text)
