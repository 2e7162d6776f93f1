"""The command ``nanorocks``: offline work without ROS."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING

from nanorocks_ros import __version__
from nanorocks_ros.cli.film_inputs import use_imports
from nanorocks_ros.cli.remedies import with_own_files
from nanorocks_ros.errors import ConfigurationError, NanorocksError

if TYPE_CHECKING:
    from collections.abc import Sequence

EXIT_INPUT = 1
EXIT_CALL = 2
EXIT_INTERRUPTED = 130
_NO_MEMORY = (
    'the memory is full; close other programs, pass fewer --workers, or take a machine with more'
)


COMMANDS = {
    'analyse': 'analyse',
    'autocorrelation': 'autocorrelation',
    'calibrate': 'calibration.calibrate',
    'calibrate-area': 'calibration.calibrate_area',
    'cluster-curve': 'calibration.cluster_curve',
    'dashboard': 'dashboard',
    'doctor': 'doctor',
    'figure': 'figures.figure',
    'import': 'recordings.import_video',
    'info': 'recordings.info',
    'library': 'calibration.library',
    'look': 'look',
    'measure': 'films.measure',
    'reproduce': 'reproduce',
    'salvage': 'recordings.salvage',
    'simulate': 'simulation.simulate',
    'speeds': 'speeds',
    'statistics': 'statistics',
    'sweep': 'simulation.sweep',
    'track': 'films.track',
    'tray': 'films.tray',
}
"""By command, the module of `nanorocks_ros.cli` that adds its parser; in the order of the help."""


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands; heavy imports wait until a command runs."""
    parser = argparse.ArgumentParser(
        prog='nanorocks',
        description='Coefficient of restitution, with its interval, from films of granular gases.',
    )
    parser.add_argument('--version', action='version', version=f'nanorocks {__version__}')
    commands = parser.add_subparsers(dest='command', metavar='COMMAND', required=True)
    for module in COMMANDS.values():
        import_module(f'nanorocks_ros.cli.{module}').add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit code.

    Returns
    -------
    int
        0 after success, 1 for unusable input, 2 for a wrong call, 3 when done with a result that
        cannot be used, 130 when interrupted.
    """
    # Set before numpy is loaded: arrays here are too small for a second thread.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # Progress messages of the package; of other packages only warnings.
    logging.basicConfig(format='nanorocks: %(message)s')
    logging.getLogger('nanorocks_ros').setLevel(logging.INFO)
    # Its messages about missing fonts are of no use to the user.
    logging.getLogger('matplotlib.font_manager').setLevel(logging.ERROR)
    options = None
    try:
        options = build_parser().parse_args(arguments)
        use_imports(options)
        code: int = options.run(options)
    except ConfigurationError as error:
        print(f'nanorocks: {with_own_files(str(error), options)}', file=sys.stderr)
        return EXIT_CALL
    except NanorocksError as error:
        print(f'nanorocks: {with_own_files(str(error), options)}', file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt as interruption:
        message = str(interruption) or 'files written so far can be read'
        print(f'nanorocks: interrupted; {message}', file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of the output closed the pipe.
        sys.stderr.close()
        return 0
    except MemoryError:
        print(f'nanorocks: {_NO_MEMORY}', file=sys.stderr)
        return EXIT_INPUT
    except RecursionError:
        print(
            'nanorocks: an input is nested too deeply; check where it comes from', file=sys.stderr
        )
        return EXIT_INPUT
    except OSError as error:
        from nanorocks_ros.outputs.safe_text import printable

        where = '' if error.filename is None else f'{printable(str(error.filename))}: '
        message = f'{where}{error.strerror or error}'
        print(f'nanorocks: {message}; free some space, or write elsewhere', file=sys.stderr)
        return EXIT_INPUT
    return code
