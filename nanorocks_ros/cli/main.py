"""The command ``nanorocks``: offline work without ROS."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from nanorocks_ros.cli.interrupts import Interrupts
from nanorocks_ros.cli.notices import tell

# All else is imported where an interruption is one line.
if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from nanorocks_ros.cli.parsing.command_parser import CommandParser

EXIT_INPUT = 1
EXIT_CALL = 2
EXIT_INTERRUPTED = 130
_NO_MEMORY = (
    'the memory is full; close other programs, pass fewer --workers, or take a machine with more'
)
_TOO_DEEP = 'an input is nested too deeply; check where it comes from'


COMMANDS = {
    'measure': {
        'measure': 'films.measure',
        'tray': 'films.tray',
        'track': 'films.track',
        'analyse': 'analyse',
        'statistics': 'statistics',
        'speeds': 'inspection.speeds',
        'autocorrelation': 'inspection.autocorrelation_sizes',
    },
    'simulate': {
        'simulate': 'simulation.simulate',
        'sweep': 'simulation.sweep',
        'library': 'calibration.library',
        'cluster-curve': 'calibration.calibrate_clusters',
        'reproduce': 'reproduce',
    },
    'draw': {
        'figure': 'figures.figure',
        'look': 'inspection.look',
    },
    'prepare recordings': {
        'import': 'recordings.import_video',
        'info': 'recordings.info',
        'salvage': 'recordings.salvage_bag',
        'calibrate': 'calibration.calibrate',
        'calibrate-area': 'calibration.calibrate_area',
    },
    'look after the machine': {
        'dashboard': 'live_page',
        'doctor': 'doctor',
        'compile': 'compile_functions',
        'completion': 'parsing.completion',
    },
}
"""By task and command, the module of `nanorocks_ros.cli` that adds its parser; as in the help."""


def build_parser(command: str | None = None) -> CommandParser:
    """The parser of all commands; heavy imports wait until a command runs.

    Parameters
    ----------
    command : str, optional
        The only command that is parsed: the modules of the others are not imported.
    """
    from importlib import import_module

    from nanorocks_ros import __version__
    from nanorocks_ros.cli.parsing.command_parser import CommandParser

    parser = CommandParser(
        prog='nanorocks',
        description='Coefficient of restitution, with its interval, from films of granular gases.',
        epilog='The options of a command: nanorocks COMMAND --help',
    )
    parser.add_argument('--version', action='version', version=f'nanorocks {__version__}')
    commands = parser.add_subparsers(dest='command', metavar='COMMAND', required=True)
    all_modules = {name: path for task in COMMANDS.values() for name, path in task.items()}
    # What completes them is made of all commands.
    if command in all_modules and command != 'completion':
        import_module(f'nanorocks_ros.cli.{all_modules[command]}').add_parser(commands)
        return parser
    for module in all_modules.values():
        import_module(f'nanorocks_ros.cli.{module}').add_parser(commands)
    parser.group_commands(COMMANDS)
    parser.set_defaults(parser=parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit code.

    Returns
    -------
    int
        0 after success, 1 for unusable input, 2 for a wrong call, 3 when done with a result that
        cannot be used, 130 when interrupted.
    """
    options = None
    with Interrupts() as interrupts:
        try:
            _set_up()
            words = sys.argv[1:] if arguments is None else arguments
            options = build_parser(*words[:1]).parse_args(words)
            return _run(options)
        except KeyboardInterrupt as interruption:
            return _interrupted(str(interruption))
        except Exception as error:
            if interrupts.seen:
                return _interrupted('')
            return _failed(error, options)


def _set_up() -> None:
    import logging

    # Set before numpy is loaded: arrays here are too small for a second thread.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # Progress messages of the package; of other packages only warnings.
    logging.basicConfig(format='nanorocks: %(message)s')
    logging.getLogger('nanorocks_ros').setLevel(logging.INFO)
    # Its messages about missing fonts are of no use to the user.
    logging.getLogger('matplotlib.font_manager').setLevel(logging.ERROR)


def _run(options: argparse.Namespace) -> int:
    from nanorocks_ros.cli.imported_films import use_imports

    use_imports(options)
    code: int = options.run(options)
    return code


def _interrupted(message: str) -> int:
    _say(f'interrupted; {message or "files written so far can be read"}')
    return EXIT_INTERRUPTED


def _failed(error: Exception, options: argparse.Namespace | None) -> int:
    """Say in one line what is wrong; the exit code. Errors of the program are raised again."""
    from nanorocks_ros.cli.remedies import with_own_files
    from nanorocks_ros.errors import ConfigurationError, NanorocksError

    if isinstance(error, BrokenPipeError):
        # The reader of the output closed the pipe.
        sys.stderr.close()
        return 0
    if isinstance(error, NanorocksError):
        _say(with_own_files(str(error), options))
        return EXIT_CALL if isinstance(error, ConfigurationError) else EXIT_INPUT
    if isinstance(error, MemoryError):
        _say(_NO_MEMORY)
    elif isinstance(error, RecursionError):
        _say(_TOO_DEEP)
    elif isinstance(error, OSError):
        from nanorocks_ros.outputs.safe_text import printable

        where = '' if error.filename is None else f'{printable(str(error.filename))}: '
        _say(f'{where}{error.strerror or error}; free some space, or write elsewhere')
    else:
        raise error
    return EXIT_INPUT


def _say(line: str) -> None:
    tell(line)
