"""Where a recording came from: what is kept of its source, and whether all of it is there."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

_BLOCK_BYTES = 1 << 20
# What an import and a salvage remark under their names at the start, and at the end.
IMPORT, SALVAGE = 'import', 'salvage'
UNFINISHED, COMPLETE = 'unfinished', 'complete'


class Unfinished(NamedTuple):
    """What a recording lacks since its making was interrupted, and what to do about it."""

    what: str
    remedy: str


_INTERRUPTED = {
    IMPORT: Unfinished(
        'holds only part of the film, since its import was interrupted', 'import it again'
    ),
    SALVAGE: Unfinished(
        'holds only part of what was salvaged, since that was interrupted',
        'salvage the damaged bag again',
    ),
}


def unfinished(metadata: Mapping[str, str]) -> tuple[Unfinished, ...]:
    """What was interrupted of the making of a recording.

    Parameters
    ----------
    metadata : mapping of str to str
        Its provenance.
    """
    return tuple(one for key, one in _INTERRUPTED.items() if metadata.get(key) == UNFINISHED)


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
