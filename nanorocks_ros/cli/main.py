"""The command ``nanorocks``: offline work without ROS."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from typing import TYPE_CHECKING

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError, NanorocksError

if TYPE_CHECKING:
    from collections.abc import Sequence

EXIT_INPUT = 1
EXIT_CALL = 2
EXIT_INTERRUPTED = 130


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command; heavy imports wait until a command runs."""
    from nanorocks_ros.cli import (
        analyse,
        autocorrelation,
        dashboard,
        doctor,
        look,
        reproduce,
        speeds,
        track,
    )
    from nanorocks_ros.cli.calibration import calibrate, calibrate_area, cluster_curve, library
    from nanorocks_ros.cli.figures import figure
    from nanorocks_ros.cli.recordings import import_video, info, salvage
    from nanorocks_ros.cli.simulation import simulate, sweep

    parser = argparse.ArgumentParser(
        prog='nanorocks',
        description='Coefficient of restitution, with its interval, from films of granular gases.',
    )
    parser.add_argument('--version', action='version', version=f'nanorocks {__version__}')
    commands = parser.add_subparsers(dest='command', metavar='COMMAND', required=True)
    analyse.add_parser(commands)
    autocorrelation.add_parser(commands)
    calibrate.add_parser(commands)
    calibrate_area.add_parser(commands)
    cluster_curve.add_parser(commands)
    dashboard.add_parser(commands)
    doctor.add_parser(commands)
    figure.add_parser(commands)
    import_video.add_parser(commands)
    info.add_parser(commands)
    library.add_parser(commands)
    look.add_parser(commands)
    reproduce.add_parser(commands)
    salvage.add_parser(commands)
    simulate.add_parser(commands)
    speeds.add_parser(commands)
    sweep.add_parser(commands)
    track.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit code.

    Returns
    -------
    int
        0 when the work was done, 2 for a wrong call, 1 for input that cannot be used, 130
        when interrupted.
    """
    # Before numpy is loaded: no array here is worth a second thread.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # What the core has to say while it works; of others, warnings only.
    logging.basicConfig(format='nanorocks: %(message)s')
    logging.getLogger('nanorocks_ros').setLevel(logging.INFO)
    # Which fonts of its own it did not find is no concern of who asked for a figure.
    logging.getLogger('matplotlib.font_manager').setLevel(logging.ERROR)
    try:
        options = build_parser().parse_args(arguments)
        code: int = options.run(options)
    except ConfigurationError as error:
        print(f'nanorocks: {error}', file=sys.stderr)
        return EXIT_CALL
    except NanorocksError as error:
        print(f'nanorocks: {error}', file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt as interruption:
        what = str(interruption) or 'what was written until now can be read'
        print(f'nanorocks: interrupted; {what}', file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has enough of it.
        sys.stderr.close()
        return 0
    except OSError as error:
        from nanorocks_ros.outputs.safe_text import printable

        where = '' if error.filename is None else f'{printable(str(error.filename))}: '
        what = f'{where}{error.strerror or error}'
        print(f'nanorocks: {what}; make room, or write elsewhere', file=sys.stderr)
        return EXIT_INPUT
    return code
