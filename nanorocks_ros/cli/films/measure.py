"""``nanorocks measure FILM -o OUT``: all that a film says, from its import to one page.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.experiment.recorded_experiment import RecordedSettings
    from nanorocks_ros.jobs.progress import Progress

_EPILOG = """\
Examples:

  nanorocks measure film.mp4 --diameter-px 31 -o out
  nanorocks measure film.mp4 --trays-file mine.yaml -o out

The second knows the container (`nanorocks tray` writes the file), so that the decay of the speeds
is read as well. The same command continues after an interruption, and takes finished steps from
the folder. Exit code 3: done, but the beads are not recognised well enough.
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.films.film_options import add_film_options, leave_out_film_options
    from nanorocks_ros.cli.flags import add_bag

    parser = commands.add_parser(
        'measure',
        help='measure a film: tracks, speeds, contacts, restitutions, one page',
        epilog=_EPILOG,
    )
    add_bag(parser)
    add_film_options(parser)
    parser.add_argument('-o', '--output', required=True, help='folder for the results')
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    leave_out_film_options(parser)
    parser.leave_out('--trays', '--workers')
    parser.set_defaults(run=run)


class _Terminal:
    """Lines and bars on the terminal; lines go to standard error where JSON is printed."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._stream = sys.stderr if options.json else sys.stdout

    def say(self, line: str) -> None:
        from nanorocks_ros.cli.remedies import with_own_files
        from nanorocks_ros.outputs.safe_text import printable

        print(printable(with_own_files(line, self._options)), file=self._stream, flush=True)

    @contextmanager
    def progress(self, label: str) -> Iterator[Progress]:
        from nanorocks_ros.cli.progress_bar import Progress as Bar

        with Bar(label) as bar:
            yield bar.count


def run(options: argparse.Namespace) -> int:
    """Measure, print and write, and return the exit code."""
    from nanorocks_ros.cli.remedies import with_own_files
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.studies.analysis.recognition_verdicts import EXIT_NOT_USABLE
    from nanorocks_ros.studies.measure.measure_film import MeasurePlan, measure_film

    bag = Path(options.bag)
    recorded = _settings(options, bag)
    plan = MeasurePlan(
        bag=bag,
        name=Path(options.named[0]).name,
        folder=Path(options.output),
        settings=recorded.settings,
        image_topic=options.image_topic,
        workers=Workers(processes=options.workers),
        name_files=partial(with_own_files, options=options),
    )
    with interruption_says('the same command continues'):
        measured = measure_film(plan, _Terminal(options))
    if options.json:
        values = {str(tray.number): tray.as_json() for tray in measured.trays}
        print(json.dumps({'usable': measured.usable, 'trays': values}, allow_nan=False))
    print(f'nanorocks: report in {measured.report}', file=sys.stderr)
    return 0 if measured.usable else EXIT_NOT_USABLE


def _settings(options: argparse.Namespace, bag: Path) -> RecordedSettings:
    """Settings of the film: by its options, by a trays file, or by what the bag says."""
    from nanorocks_ros.cli.films.film_options import use_described_film
    from nanorocks_ros.cli.flags import bag_settings
    from nanorocks_ros.cli.remedies import print_notices

    print_notices(use_described_film(options, bag), options)
    recorded = bag_settings(options, bag)
    if not recorded.trays_known:
        film = shlex.quote(options.named[0])
        raise ConfigurationError(
            options.named[0],
            'nothing is known of its beads',
            f'have their diameter found: nanorocks measure {film} --diameter-px auto -o '
            f'{shlex.quote(options.output)}; or give it in px, or a file, as --trays-file '
            'mine.yaml',
        )
    print_notices(recorded.notices, options)
    return recorded
