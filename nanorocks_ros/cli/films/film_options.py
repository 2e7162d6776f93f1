"""Options that describe the beads and the container of a film, in place of a trays file."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import AUTO

if TYPE_CHECKING:
    from nanorocks_ros.cli.parsing.command_parser import CommandParser
    from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray

_MM = 1e-3


def add_film_options(parser: argparse.ArgumentParser) -> None:
    """Add the options; each species of beads has its diameter, count and density."""
    group = parser.add_argument_group('the film, in place of a trays file')
    several: dict[str, Any] = {'type': float, 'nargs': '+'}
    for unit, where in (('px', ' in the picture'), ('mm', '')):
        group.add_argument(
            f'--diameter-{unit}',
            metavar=unit.upper(),
            help=f'diameter of the beads{where}',
            **several,
        )
    group.add_argument('--count', type=int, nargs='+', metavar='N', help='number of beads')
    group.add_argument(
        '--look', nargs='+', metavar='LOOK', help='dark, bright or auto (default), on the floor'
    )
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


def leave_out_film_options(parser: CommandParser) -> None:
    """Leave the finer of the options, and what they replace, out of the short help."""
    scale = '--preprocess-pixels-per-metre', '--preprocess-calibration'
    parser.leave_out('--look', '--colour', '--density-g-cm3', '--corners', *scale)


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
    from nanorocks_ros.studies.measure.film_samples import film_samples
    from nanorocks_ros.studies.measure.film_tray import described_tray

    filmed = filmed_tray(options)
    if filmed is None:
        return ()
    if options.trays_file:
        raise ConfigurationError(
            '--diameter-px', 'and --trays-file both describe the beads', 'leave out one of them'
        )
    samples = film_samples(bag, options.image_topic)
    tray = described_tray(filmed, samples.size)
    options.trays_file = tray.text
    return tray.notices


def print_notices(notices: tuple[str, ...]) -> None:
    """Print notices for the user, one line each."""
    for notice in notices:
        print(f'nanorocks: {notice}', file=sys.stderr)


def filmed_tray(options: argparse.Namespace) -> FilmedTray | None:
    """What the options say of the film; None without a diameter in pixels.

    Raises
    ------
    ConfigurationError
        For lists of different lengths, and numbers that cannot be.
    """
    from nanorocks_ros.studies.measure.film_tray import FilmedTray

    _check(options)
    if not options.diameter_px:
        return None
    sides = options.sides_mm
    pairs = options.corners or []
    return FilmedTray(
        beads=tuple(_beads(options, k) for k in range(len(options.diameter_px))),
        corners_px=tuple(zip(pairs[::2], pairs[1::2], strict=True)),
        sides=None if sides is None else (_MM * sides[0], _MM * sides[1]),
        height=None if options.height_mm is None else _MM * options.height_mm,
    )


def _beads(options: argparse.Namespace, k: int) -> FilmedBeads:
    from nanorocks_ros.studies.measure.film_tray import FilmedBeads

    def value(values: list[Any] | None) -> Any:
        return None if values is None else values[k]

    diameter = value(options.diameter_mm)
    return FilmedBeads(
        diameter_px=options.diameter_px[k],
        diameter=None if diameter is None else _MM * diameter,
        count=value(options.count),
        density=value(options.density_g_cm3),
        look=value(options.look) or AUTO,
        colour=value(options.colour) or AUTO,
    )


def _check(options: argparse.Namespace) -> None:
    lists = {
        '--diameter-px': options.diameter_px,
        '--diameter-mm': options.diameter_mm,
        '--count': options.count,
        '--density-g-cm3': options.density_g_cm3,
    }
    words = {'--look': options.look, '--colour': options.colour}
    single = [] if options.height_mm is None else [options.height_mm]
    positive = {**lists, '--sides-mm': options.sides_mm, '--height-mm': single}
    for flag, values in positive.items():
        for value in values or []:
            if not (math.isfinite(value) and value > 0):
                raise ConfigurationError(flag, f'{value:g}', 'give numbers above 0')
    given = {flag: values for flag, values in (lists | words).items() if values is not None}
    others = {'--corners': options.corners, '--sides-mm': options.sides_mm, '--height-mm': single}
    if not options.diameter_px:
        for flag, values in {**given, **others}.items():
            if values:
                raise ConfigurationError(
                    flag, 'needs --diameter-px', 'add the diameter of a bead in the picture'
                )
    for flag, values in given.items():
        if options.diameter_px and len(values) != len(options.diameter_px):
            raise ConfigurationError(
                flag,
                f'{len(values)} values for {len(options.diameter_px)} of --diameter-px',
                'give one for each species',
            )
    if options.corners and len(options.corners) not in (4, 8):
        raise ConfigurationError(
            '--corners', f'{len(options.corners)} numbers', 'give two corners or four: X Y X Y'
        )
