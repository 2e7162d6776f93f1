"""Names that somebody else gave, and numbers of things, as they can be shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def shown(text: str | Path) -> str:
    """In one line, and without what a terminal, a page or a file of text would choke on.

    Parameters
    ----------
    text : str or Path
        Names of files may hold any bytes, line ends and escapes of terminals among them.
    """
    return ''.join(
        one if one.isprintable() else one.encode('unicode_escape').decode('ascii')
        for one in str(text)
    )


def counted(count: int, what: str) -> str:
    """So many of something that has a plural in s."""
    return f'{count} {what}{"" if count == 1 else "s"}'
