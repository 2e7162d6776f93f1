"""Text for terminals and pages: names of unknown origin, counted nouns."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def printable(text: str | Path) -> str:
    """Escape control characters, so that the text fits on one line of a terminal or page.

    Parameters
    ----------
    text : str or Path
        File names may hold line ends and escape sequences of terminals.
    """
    return ''.join(
        character
        if character.isprintable()
        else character.encode('unicode_escape').decode('ascii')
        for character in str(text)
    )


def counted(count: int, noun: str) -> str:
    """A number with its noun, such as ``3 frames``; the plural is formed with s."""
    return f'{count} {noun}{"" if count == 1 else "s"}'
