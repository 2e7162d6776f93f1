"""Files and folders under temporary names: whose process lives, and what killed ones left.

A process holds a lock on each file that it writes. The system drops the lock when the process
ends, however it ends.

Tested by ``test/outputs/test_unfinished_files.py``.
"""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import shutil
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_RANDOM_BYTES = 8
# A name may have 255 bytes.
_LONGEST_STEM_BYTES = 100
# What stood in the place of a folder.
_EARLIER = 'earlier'
_NAME = re.compile(rf'\.(.+)\.[0-9a-f]{{{2 * _RANDOM_BYTES}}}\.part(\.[^.]+)?', re.DOTALL)
# Where the file system has no locks, files of this age have no process, [s].
_OLD_S = 3600.0


def open_unfinished(path: Path) -> tuple[Path, int]:
    """A new empty file beside a path, under a name that nobody can foresee, and its lock.

    A name that is known beforehand could be a link that somebody else put there. What killed
    processes left of the same path is deleted.

    Parameters
    ----------
    path : Path
        The file to be written.

    Returns
    -------
    Path, int
        The new file, and the descriptor that holds its lock; close it when the file is renamed.

    Raises
    ------
    OSError
        When it cannot be made.
    """
    delete_unfinished(path.parent, _stem(path.stem), path.suffix)
    while True:
        part = path.parent / _hidden_name(path.stem, path.suffix)
        lock = os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        # Another process may have deleted it before the lock.
        if os.fstat(lock).st_nlink:
            return part, lock
        os.close(lock)


@contextmanager
def unfinished_folder(path: Path) -> Iterator[Path]:
    """A new folder with a hidden name beside a path, deleted at the end.

    Parameters
    ----------
    path : Path
        The folder to be made. What killed processes left of the same path goes first.

    Yields
    ------
    Path

    Raises
    ------
    OSError
        When it cannot be made.
    """
    delete_unfinished_folders(path.parent, path.name)
    while True:
        folder = path.parent / _hidden_name(path.name)
        folder.mkdir(0o700)
        with _lock_of(folder) as descriptor:
            if descriptor is None:
                # Another process deleted it before the lock.
                continue
            with suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if not folder.is_dir():
                continue
            try:
                yield folder
            finally:
                shutil.rmtree(folder, ignore_errors=True)
            return


def exchange_folder(folder: Path, fresh: Path, part: Path) -> None:
    """Put a new folder in the place of one that there may be, which is deleted with `part`.

    Parameters
    ----------
    folder, fresh : Path
    part : Path
        The `unfinished_folder` of `folder`. If the process is killed between the two steps, the
        next one puts the earlier folder back.

    Raises
    ------
    OSError
        When a name cannot be changed.
    """
    if folder.exists():
        folder.rename(part / _EARLIER)
    fresh.rename(folder)


def delete_unfinished_folders(parent: Path, name: str | None = None) -> None:
    """Delete unfinished folders whose processes have ended.

    Parameters
    ----------
    parent : Path
    name : str, optional
        Of the finished folder, which gets back what was taken from its place; by default any.
    """
    for part, its_stem, its_suffix in _unfinished(parent):
        if name is not None and its_stem + its_suffix != _stem(name):
            continue
        with _lock_of(part) as descriptor:
            if descriptor is None or not _has_no_process(descriptor):
                continue
            earlier = part / _EARLIER
            if name and earlier.is_dir() and not os.path.lexists(parent / name):
                earlier.rename(parent / name)
            shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _lock_of(folder: Path) -> Iterator[int | None]:
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        yield None
        return
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def delete_unfinished(folder: Path, stem: str = '', suffix: str = '') -> None:
    """Delete unfinished files of a folder whose processes have ended.

    Parameters
    ----------
    folder : Path
    stem, suffix : str
        Of the finished file; by default of any.
    """
    with suppress(OSError):
        for part, its_stem, its_suffix in _unfinished(folder):
            if not stem or (its_stem, its_suffix) == (stem, suffix):
                _delete_without_process(part)


def holds_files(folder: Path, *, besides: str = '') -> bool:
    """Whether a path holds anything but unfinished files; so does one that is no folder.

    Parameters
    ----------
    folder : Path
    besides : str
        Name of a file that does not count.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    if not folder.is_dir():
        return True
    return any(name != besides and not _NAME.fullmatch(name) for name in os.listdir(folder))


def _unfinished(folder: Path) -> Iterator[tuple[Path, str, str]]:
    for name in os.listdir(folder):
        match = _NAME.fullmatch(name)
        if match:
            yield folder / name, match[1], match[2] or ''


def _hidden_name(stem: str, suffix: str = '') -> str:
    return f'.{_stem(stem)}.{secrets.token_hex(_RANDOM_BYTES)}.part{suffix}'


def _stem(name: str) -> str:
    return os.fsencode(name)[:_LONGEST_STEM_BYTES].decode('utf-8', 'ignore')


def _delete_without_process(part: Path) -> None:
    with suppress(OSError):
        descriptor = os.open(part, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            if _has_no_process(descriptor):
                part.unlink(missing_ok=True)
        finally:
            os.close(descriptor)


def _has_no_process(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return time.time() - os.fstat(descriptor).st_mtime > _OLD_S
    return True
