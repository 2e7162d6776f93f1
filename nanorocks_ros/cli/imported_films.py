"""Films where a command takes a bag: imported beside the film, and the import used."""

from __future__ import annotations

import glob
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.jobs.interruption import interruption_says

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

_ARGUMENT = 'film_argument'


def accept_films(
    parser: argparse.ArgumentParser,
    argument: str,
    announce: Callable[[argparse.Namespace, list[str]], None] = lambda options, films: None,
) -> None:
    """Let an argument of a command, which names bags, name films as well.

    Before films are imported, which takes time, `announce` may say something of them.
    """
    parser.set_defaults(**{_ARGUMENT: argument, 'announce_films': announce})


def use_imports(options: argparse.Namespace) -> None:
    """Import the films among the bags that the options name, and put the imports there.

    `options.named` keeps what the user named: a list of str; `options.imports` has the name of
    each film by the path of its import.

    Raises
    ------
    RecordingError
        If a single name is no film and no bag, a film cannot be read, or its import cannot be
        written.
    """
    argument = getattr(options, _ARGUMENT, None)
    if argument is None:
        return
    from nanorocks_ros.recordings.bag.find_bags import is_pattern
    from nanorocks_ros.studies.film_import.named_film import check_film_or_bag

    value = getattr(options, argument)
    is_list = isinstance(value, list)
    names = [name for text in value for name in _expanded(text)] if is_list else [value]
    options.named = names
    if len(names) == 1 and not is_pattern(names[0]):
        check_film_or_bag(names[0], many=is_list)
    films = [name for name in names if _is_film(name)]
    if films:
        options.announce_films(options, films)
    recordings = [_recording(name) for name in names]
    options.imports = {
        bag: name for bag, name in zip(recordings, names, strict=True) if bag != name
    }
    setattr(options, argument, recordings if is_list else recordings[0])


def _expanded(text: str) -> list[str]:
    """The matches of a pattern that matches films; else the text."""
    from nanorocks_ros.recordings.bag.find_bags import is_pattern
    from nanorocks_ros.recordings.film.natural_sort import natural_key

    if not is_pattern(text):
        return [text]
    matches = sorted(glob.glob(text, recursive=True), key=natural_key)
    return matches if any(_is_film(match) for match in matches) else [text]


def _is_film(name: str) -> bool:
    from nanorocks_ros.studies.film_import.film_cache import is_film

    try:
        return is_film(Path(name))
    except OSError:
        # Whoever reads it as a bag reports why it cannot be read.
        return False


def _recording(name: str) -> str:
    """The import of a film, with a line that says so; other names as they are."""
    if not _is_film(name):
        return name
    from nanorocks_ros.cli.progress_bar import Progress
    from nanorocks_ros.outputs.safe_text import printable
    from nanorocks_ros.studies.film_import.film_cache import cached_import

    again = interruption_says('run the same command again to import the film')
    with again, Progress('importing') as progress:
        film = cached_import(Path(name), progress.part)
    for notice in film.notices:
        tell(notice)
    how = 'its import is used' if film.reused else 'imported'
    print(
        f'nanorocks: {printable(name)}: {how}, {film.frames} frames in {printable(film.bag)}',
        file=sys.stderr,
    )
    return str(film.bag)
