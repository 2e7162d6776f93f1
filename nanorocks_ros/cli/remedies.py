"""Remedies that can be pasted: commands in them repeat the user's own files and options."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.outputs.named_recordings import with_commands, with_film

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

# Commands in remedies that describe a tray by its number alone.
_BY_NUMBER = re.compile(
    r'nanorocks (?:library|cluster-curve|simulate) --trays? \d+(?!\d| --trays-file)'
)
# What describes a recording on the command line: the flag by the name of its value.
_DESCRIPTION = {
    'trays': '--trays',
    'trays_file': '--trays-file',
    'parameters': '--parameters',
    'image_topic': '--image-topic',
    'preprocess.calibration': '--preprocess-calibration',
    'preprocess.pixels_per_metre': '--preprocess-pixels-per-metre',
}
# The same of a film, for the commands that take it.
_FILM = {
    name: f'--{name.replace("_", "-")}'
    for name in (
        'diameter_px',
        'diameter_mm',
        'count',
        'look',
        'colour',
        'material',
        'density_g_cm3',
        'corners',
        'sides_mm',
        'height_mm',
    )
}
_TAKE_FILMS = 'track', 'measure'


def with_own_files(text: str, options: argparse.Namespace | None) -> str:
    """A message whose commands have the recording, the trays file and the options of the user.

    Parameters
    ----------
    text : str
        Of an error or a notice.
    options : Namespace or None
        Of the command; None while they are not known.
    """
    if options is None:
        return text
    text = _with_named_films(text, options)
    trays_file = _words(options, {'trays_file': '--trays-file'})
    text = _BY_NUMBER.sub(lambda match: shlex.join([*match[0].split(), *trays_file]), text)
    named_text: str = about_own_recording(text, options)
    return named_text


def print_notices(notices: Iterable[str], options: argparse.Namespace) -> None:
    """Print notices for the user, one line each, with the user's own files in them."""
    for notice in notices:
        tell(with_own_files(notice, options))


def about_own_recording(values: Any, options: argparse.Namespace) -> Any:
    """Texts, at any depth of lists and dicts, whose commands have the recording of the user."""
    named: list[str] = getattr(options, 'named', [])
    if len(named) != 1:
        return values
    return with_commands(values, lambda command: _on_recording(command, named[0], options))


def _with_named_films(text: str, options: argparse.Namespace) -> str:
    """A text that names films as the user did, where it names their imports."""
    imports: dict[str, str] = getattr(options, 'imports', {})
    for bag, film in imports.items():
        text = with_film(text, bag, film)
    return text


def results_beside(recording: str, kind: str) -> str:
    """A folder for results of a recording, in the folder where the user is."""
    return f'{Path(recording).stem or "film"}_{kind}'


def _on_recording(command: str, recording: str, options: argparse.Namespace) -> str:
    flags = {**_DESCRIPTION, **_FILM} if command in _TAKE_FILMS else _DESCRIPTION
    words = ['nanorocks', command, recording, *_words(options, flags)]
    if command == 'measure':
        words += ['-o', results_beside(recording, 'measured')]
    return shlex.join(words)


def _words(options: argparse.Namespace, flags: dict[str, str]) -> list[str]:
    """The options that the user gave, as words of a command line."""
    words = []
    for name, flag in flags.items():
        value: Any = getattr(options, name, None)
        values = [str(part) for part in (value if isinstance(value, list | tuple) else [value])]
        # A described film is a trays file whose text stands in place of its name.
        if value and not any('\n' in part for part in values):
            words += [flag, *values]
    return words
