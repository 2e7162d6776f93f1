"""Trays on the command line: `--tray` and `--trays` are numbers, `--trays-file` is a file."""

from __future__ import annotations

import argparse
import sys
from shlex import quote
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.command_parser import swallowed_name
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.safe_text import printable

if TYPE_CHECKING:
    from collections.abc import Sequence


def add_tray(parser: Any, text: str, **options: Any) -> None:
    """Add `--tray K`: the number of one tray."""
    parser.add_argument('--tray', type=_number, metavar='K', help=text, **options)


def add_trays(parser: Any, text: str) -> None:
    """Add `--trays K [K ...]`: numbers, which commas may separate as well."""
    parser.add_argument('--trays', nargs='+', action=_Numbers, default=(), metavar='K', help=text)


def add_trays_file(parser: Any, default: str = 'the trays of the flight') -> None:
    """Add `--trays-file YAML`: the file that describes the trays."""
    parser.add_argument(
        '--trays-file', default='', metavar='YAML', help=f'YAML file of trays; default: {default}'
    )


def add_tray_or_file(parser: argparse.ArgumentParser) -> None:
    """Accept `--tray` beside `--trays` and `--trays-file`: a number, or a file."""
    parser.add_argument('--tray', action=_NumberOrFile, help=argparse.SUPPRESS)


def not_a_number(word: str) -> tuple[str, str]:
    """What is wrong with a word in place of the number of a tray, and what to do."""
    remedy = f'a file of trays is --trays-file {quote(word)}'
    if not word.endswith(('.yaml', '.yml')):
        remedy = swallowed_name(word) or remedy
    return f'{word!r} is no number of a tray', remedy


def _number(word: str) -> int:
    if not word.isdigit():
        raise ConfigurationError('command line', *not_a_number(word))
    return int(word)


class _Numbers(argparse.Action):
    """Collects numbers from words such as ``1``, ``1,3``."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Add the numbers to those given before."""
        words = [part for word in values or () for part in word.split(',') if part]
        numbers = [_number(word) for word in words]
        known = getattr(namespace, self.dest) or ()
        setattr(namespace, self.dest, tuple(dict.fromkeys((*known, *numbers))))


class _NumberOrFile(argparse.Action):
    """Takes a number as `--trays` and anything else as `--trays-file`."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Put the value where the other options put it."""
        if values.isdigit():
            namespace.trays = [*(namespace.trays or []), values]
        else:
            namespace.trays_file = values
            name = printable(values)
            print(
                f'nanorocks: --tray {name}: taken as --trays-file, for this release only; use '
                f'--trays-file {quote(name)}',
                file=sys.stderr,
            )
