"""Remedies that can be pasted: commands in them repeat the user's own files."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

# Commands in remedies that describe a tray by its number alone.
_COMMAND = re.compile(r'nanorocks (?:library|cluster-curve|simulate) --tray \d+')


def with_own_files(text: str, options: argparse.Namespace | None) -> str:
    """A message whose commands have the trays file of the user.

    Parameters
    ----------
    text : str
        Of an error.
    options : Namespace or None
        Of the command; None while they are not known.
    """
    trays_file = getattr(options, 'trays_file', None) or ''
    if not trays_file or '\n' in trays_file:
        return text
    return _COMMAND.sub(
        lambda match: f'{match[0]} --trays-file {shlex.quote(trays_file)}',
        text,
    )
