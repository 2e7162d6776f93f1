"""Options that describe the beads and the container of a film, in place of a trays file."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from nanorocks_ros.experiment.appearance import AUTO

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.cli.parsing.command_parser import CommandParser


def add_film_options(parser: argparse.ArgumentParser) -> None:
    """Add the options; each species of beads has its diameter, count and density."""
    group = parser.add_argument_group('the film, in place of a trays file')
    several: dict[str, Any] = {'type': float, 'nargs': '+'}
    group.add_argument(
        '--diameter-px',
        type=_size,
        nargs='+',
        metavar='PX',
        help='diameter of the beads in the picture; auto: found in the film',
    )
    group.add_argument('--diameter-mm', metavar='MM', help='diameter of the beads', **several)
    group.add_argument('--count', type=int, nargs='+', metavar='N', help='number of beads')
    group.add_argument(
        '--look', nargs='+', metavar='LOOK', help='dark, bright or auto (default), on the floor'
    )
    group.add_argument('--material', nargs='+', metavar='NAME', help='its name; default: beads')
    group.add_argument(
        '--colour', nargs='+', metavar='COLOUR', help='name, "#rrggbb" or auto (default)'
    )
    group.add_argument(
        '--density-g-cm3', metavar='G/CM3', help='density of the beads; default 1', **several
    )
    group.add_argument(
        '--corners',
        type=float,
        nargs='+',
        metavar='PX',
        help='column and row of two opposite corners of the container, or of all four; '
        'default: the whole picture',
    )
    group.add_argument(
        '--sides-mm',
        type=float,
        nargs=2,
        metavar=('LENGTH', 'WIDTH'),
        help='inner sides of the container, along columns and rows',
    )
    group.add_argument(
        '--height-mm',
        type=float,
        metavar='MM',
        help='inner height of the container, along the line of sight; the diameter for one layer',
    )


def _size(word: str) -> float | str:
    return word if word == AUTO else float(word)


# Its name is in the error of a word that is no number.
_size.__name__ = 'float'


def leave_out_film_options(parser: CommandParser) -> None:
    """Leave the finer of the options, and what they replace, out of the short help."""
    scale = '--preprocess-pixels-per-metre', '--preprocess-calibration'
    finer = '--look', '--colour', '--material', '--density-g-cm3', '--corners'
    parser.leave_out(*finer, *scale)


def use_described_film(options: argparse.Namespace, bag: Path) -> tuple[str, ...]:
    """Put the trays file that the options describe in their place; notices of what was guessed.

    Nothing happens without `--diameter-px`.

    Raises
    ------
    ConfigurationError
        For options that do not fit each other or the picture.
    RecordingError
        When the recording cannot be read.
    """
    from nanorocks_ros.studies.measure.told_film import described_film

    film: Any = options
    tray = described_film(film, bag, options.image_topic, options.trays_file)
    if tray is None:
        return ()
    options.trays_file = tray.text
    return tray.notices
