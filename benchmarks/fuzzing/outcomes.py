"""What a program may do with damaged input, from best to worst."""

from __future__ import annotations

from typing import NamedTuple

SAME = 'same'
"""The same result as of the intact input: the damage was where nothing is read."""
TOLD = 'told'
"""A result, and a word about the damage."""
CLEAN_ERROR = 'clean error'
"""One line that names the file and a remedy."""
NO_CHECKSUM = 'cannot be noticed'
"""Another result, and no word about it: the input has no checksum, or one that is right."""
SILENT = 'silent difference'
"""Another result, and no word about it, although the input has a checksum."""
TRACEBACK = 'traceback'
HANG = 'hang'
MEMORY = 'memory'

CLASSES = (SAME, TOLD, CLEAN_ERROR, NO_CHECKSUM, SILENT, TRACEBACK, HANG, MEMORY)
BAD = (SILENT, TRACEBACK, HANG, MEMORY)


class Outcome(NamedTuple):
    """The outcome of one mutation.

    Parameters
    ----------
    name : str
        One of `CLASSES`.
    group : str
        Kind of input.
    damage : str
    detail : str
        The error, on one line.
    numbers : dict of str to int
    """

    name: str
    group: str
    damage: str
    detail: str = ''
    numbers: dict[str, int] | None = None
