"""Names of files, in the order that people expect."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

OF_THE_DISK = frozenset({'lost+found', 'System Volume Information', '$RECYCLE.BIN'})
"""Folders that a system keeps on a disk for itself."""


def natural(name: str) -> list[tuple[int, str]]:
    """A key that sorts `run_10.mcap` behind `run_9.mcap`."""
    parts = re.split(r'(\d+)', name)
    return [(int(part), '') if part.isdecimal() else (-1, part) for part in parts]


def numbers_of(names: Sequence[str]) -> list[int] | None:
    """The numbers in which alone names differ; None where they differ in more, or in none.

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
