"""A folder that one process at a time works in."""

from __future__ import annotations

import fcntl
import os
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

LOCK = 'lock'


def hold_folder(folder: Path, name: str = LOCK) -> int:
    """Make a folder and hold it until what is returned is closed, or the process ends.

    Parameters
    ----------
    folder : Path
    name : str
        Of the file in it that is locked.

    Returns
    -------
    int
        Descriptor of that file.

    Raises
    ------
    RecordingError
        When the folder cannot be used, or is held by another process.
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
