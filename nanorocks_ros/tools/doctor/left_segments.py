"""Shared memory of Fast DDS that killed nodes left behind.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

import fcntl
from contextlib import suppress
from pathlib import Path

SHARED_MEMORY = Path('/dev/shm')
"""Where Linux keeps shared memory."""

# Beside each segment lies a file that its program keeps locked as long as it lives.
_LOCK_SUFFIX = '_el'
_LOCKS = f'fastrtps_*{_LOCK_SUFFIX}'


def left_bytes(folder: Path = SHARED_MEMORY) -> int:
    """Size of all segments whose programs have ended, [bytes]; those of other users do not count.

    Parameters
    ----------
    folder : Path
    """
    size = 0
    for segment in _left_segments(folder):
        with suppress(FileNotFoundError):
            size += segment.stat().st_size
    return size


def remove_left_segments(folder: Path = SHARED_MEMORY) -> None:
    """Remove the segments of programs that have ended, with their locks."""
    for segment in _left_segments(folder):
        segment.unlink(missing_ok=True)
        segment.with_name(segment.name + _LOCK_SUFFIX).unlink(missing_ok=True)


def removal_command(folder: Path = SHARED_MEMORY) -> str:
    """Command of a shell that does so; programs that run keep theirs."""
    return (
        f'for lock in {folder}/{_LOCKS}; '
        f'do flock --nonblock "$lock" rm -f "${{lock%{_LOCK_SUFFIX}}}" "$lock"; done'
    )


def _left_segments(folder: Path) -> list[Path]:
    return [
        lock.with_name(lock.name.removesuffix(_LOCK_SUFFIX))
        for lock in sorted(folder.glob(_LOCKS))
        if not _is_held(lock)
    ]


def _is_held(lock: Path) -> bool:
    """Whether a program holds the lock, or this user may not ask."""
    try:
        with lock.open('rb') as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    return False
