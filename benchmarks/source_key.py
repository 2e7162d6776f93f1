"""A key of the code that measures: results kept under it are of one state of the code."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


@cache
def source_key(*names: str) -> str:
    """Key of the package and of these modules of the benchmarks.

    Parameters
    ----------
    *names : str
        File names.
    """
    here = Path(__file__).resolve().parent
    files = sorted((here.parent / 'nanorocks_ros').rglob('*.py'))
    files += [here / name for name in names]
    return key_of(files)


def key_of(files: Iterable[Path]) -> str:
    """Key of the contents of files, in this order."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
