"""Errors and notices that name flags of the command, in the words of Python."""

from __future__ import annotations

import re
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, rows

if TYPE_CHECKING:
    from collections.abc import Iterator

# A word of a flag; what follows a flag of a command in backquotes stays as it is.
_FLAG = re.compile(r'(?<![\w`-])--([a-z][a-z0-9]*(?:-[a-z0-9]+)*)')
_COMMAND = re.compile(r'(`[^`]*`|\bnanorocks [a-z][^;`]*)')
# Of flags that have another name in Python.
_OTHERS = {
    'start': '--start of `nanorocks import`',
    'output': 'folder',
    'include_inconsistent': 'cooling.include_inconsistent',
}


def python_words(text: str) -> str:
    """The text with keywords and settings in place of flags: ``height_mm`` for ``--height-mm``.

    Commands are left as they are: in backquotes, or from ``nanorocks`` to the next semicolon.
    """
    parts = _COMMAND.split(text)
    return ''.join(
        part if _COMMAND.fullmatch(part) else _FLAG.sub(lambda flag: _keyword(flag[1]), part)
        for part in parts
    )


def _keyword(flag: str) -> str:
    name = flag.replace('-', '_')
    return _settings().get(name) or _OTHERS.get(name, name)


@cache
def _settings() -> dict[str, str]:
    """Names of the settings by those of their flags."""
    names = [row.name for kind in (SimulationSettings(), PipelineSettings()) for row in rows(kind)]
    return {name.replace('.', '_'): name for name in names}


@contextmanager
def in_python() -> Iterator[None]:
    """Raise errors of the package in the words of Python."""
    try:
        yield
    except NanorocksError as error:
        words = [python_words(part) for part in (error.where, error.what, error.do)]
        if words == [error.where, error.what, error.do]:
            raise
        raise type(error)(*words) from error
