"""Natural sorting of file names, and the running number in them.

Tested by ``test/recordings/bag/test_find_bags.py``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

SYSTEM_FOLDERS = frozenset({'lost+found', 'System Volume Information', '$RECYCLE.BIN'})
"""Folders of the operating system on a disk."""


def natural_key(name: str) -> list[tuple[int, str]]:
    """Sort key that sorts ``run_10.mcap`` after ``run_9.mcap``."""
    parts = re.split(r'(\d+)', name)
    return [(int(part), '') if part.isdecimal() else (-1, part) for part in parts]


def varying_numbers(names: Sequence[str]) -> list[int] | None:
    """The number in each name, if the names differ in exactly one number; else None.

    Parameters
    ----------
    names : sequence of str
        At least one.
    """
    parts = [re.split(r'(\d+)', name) for name in names]
    if any(len(part) != len(parts[0]) for part in parts):
        return None
    differing = [column for column in zip(*parts, strict=True) if len(set(column)) > 1]
    if len(differing) != 1 or not all(part.isdecimal() for part in differing[0]):
        return None
    return [int(part) for part in differing[0]]
