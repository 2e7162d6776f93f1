"""A lock that lets one process at a time use a folder.

Tested by ``test/jobs/test_journal.py``.
"""

from __future__ import annotations

import fcntl
import os
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

LOCK = 'lock'


def lock_folder(folder: Path, name: str = LOCK) -> int:
    """Make a folder and lock it.

    Parameters
    ----------
    folder : Path
    name : str
        Name of the lock file in it.

    Returns
    -------
    int
        Descriptor of the lock file; closing it, or the end of the process, unlocks the folder.

    Raises
    ------
    RecordingError
        When the folder cannot be used, or is locked by another process.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(folder / name, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise RecordingError(
            str(folder), f'cannot be written ({error.strerror})', 'pass a writable --output'
        ) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock)
        raise RecordingError(
            str(folder), 'is in use by another process', 'wait for it, or pass another --output'
        ) from error
    return lock
