"""Messages name the recording as the user did, and their commands can be pasted."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# Commands in remedies that stand for the recording by a word.
_ON_RECORDING = re.compile(r'nanorocks (look|speeds|track|measure|statistics) (?:BAG|FILM)\b')


def with_recording(values: Any, recording: str | Path) -> Any:
    """Texts whose commands name the recording.

    Parameters
    ----------
    values : str, list, tuple, dict, or anything else
        Texts are replaced at any depth; anything else stays.
    recording : str or Path
        As it is typed in a shell; it is quoted.
    """
    path = shlex.quote(str(recording))
    return with_commands(values, lambda command: f'nanorocks {command} {path}')


def with_film(text: str, bag: str | Path, film: str | Path) -> str:
    """A text that names a film where it names the bag that was made of it.

    Parameters
    ----------
    text : str
    bag : str or Path
    film : str or Path
        As the user named it.
    """
    if str(bag) == str(film):
        return text
    # The one topic of such a bag is of no interest to whoever has a film.
    own = rf'{re.escape(str(bag))}(?![\w/.-])(: /[\w/]+(?=: ))?'
    return re.sub(own, lambda _: str(film), text)


def with_commands(values: Any, command_line: Callable[[str], str]) -> Any:
    """As `with_recording`, with any beginning of the command line.

    Parameters
    ----------
    values : str, list, tuple, dict, or anything else
    command_line : callable
        Of the name of a command: the words up to the recording and what describes it.
    """
    if isinstance(values, str):
        return _ON_RECORDING.sub(lambda match: command_line(match[1]), values)
    if isinstance(values, dict):
        return {key: with_commands(value, command_line) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [with_commands(value, command_line) for value in values]
    return values
