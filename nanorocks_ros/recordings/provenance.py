"""Where a recording came from: what is kept of its source."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

_BLOCK_BYTES = 1 << 20


def checksum(files: Iterable[Path]) -> str:
    """SHA-256 of the contents of files, one after another.

    Raises
    ------
    RecordingError
        When one cannot be read.
    """
    found = hashlib.sha256()
    for file in files:
        try:
            with file.open('rb') as stream:
                while block := stream.read(_BLOCK_BYTES):
                    found.update(block)
        except OSError as error:
            raise RecordingError(
                str(file), f'cannot be read ({error.strerror})', 'check its permissions'
            ) from error
    return found.hexdigest()
