"""Provenance of a recording: checksum of its source, and whether an import or salvage finished.

Tested by ``test/recordings/bag/test_salvage.py``.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

_BLOCK_BYTES = 1 << 20
# Metadata keys of an import and of a salvage, and their values at the start and at the end.
IMPORT, SALVAGE = 'import', 'salvage'
UNFINISHED, COMPLETE = 'unfinished', 'complete'


class Interruption(NamedTuple):
    """An interrupted import or salvage: its consequence and the remedy."""

    what: str
    remedy: str


_INTERRUPTED = {
    IMPORT: Interruption(
        'holds only part of the film because its import was interrupted', 'import it again'
    ),
    SALVAGE: Interruption(
        'holds only part of the readable messages because its salvage was interrupted',
        'salvage the damaged bag again',
    ),
}


def interruptions(metadata: Mapping[str, str]) -> tuple[Interruption, ...]:
    """Interrupted steps (import, salvage) in the making of a recording.

    Parameters
    ----------
    metadata : mapping of str to str
        Provenance of the recording.
    """
    return tuple(
        interruption
        for key, interruption in _INTERRUPTED.items()
        if metadata.get(key) == UNFINISHED
    )


def checksum(files: Iterable[Path]) -> str:
    """SHA-256 of the concatenated contents of files.

    Raises
    ------
    RecordingError
        If a file cannot be read.
    """
    digest = hashlib.sha256()
    for file in files:
        try:
            with file.open('rb') as stream:
                while block := stream.read(_BLOCK_BYTES):
                    digest.update(block)
        except OSError as error:
            raise RecordingError(
                str(file), f'cannot be read ({error.strerror})', 'check its permissions'
            ) from error
    return digest.hexdigest()
