"""Lets one process at a time compile a function; others wait, and load what it has compiled.

Without it, processes that start together on a new machine, as nodes, worker processes and workers
of the tests do, each compile the same functions, at the same time.
"""

from __future__ import annotations

import fcntl
import os
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

# After so long a process compiles in spite of another, which may be stopped, [s].
_PATIENCE_S = 300.0
_STEP_S = 0.05


def compile_once(dispatcher: Any, folder: Path) -> None:
    """Let only one process of those that use a folder compile a function.

    Parameters
    ----------
    dispatcher : numba dispatcher
        With ``cache=True``.
    folder : Path
        Where the compiled versions are kept.
    """
    cache, compiler = dispatcher._cache, dispatcher._compiler
    load, save, compile_version = cache.load_overload, cache.save_overload, compiler.compile
    lock = _Lock(folder / f'{cache._impl.filename_base}.lock')

    # numba calls these under the lock of its compiler: in one thread at a time.
    def load_or_wait(signature: Any, context: Any) -> Any:
        found = load(signature, context)
        if found is None and cache._enabled:
            lock.acquire()
            found = load(signature, context)
            if found is not None:
                lock.release()
        return found

    def compile_or_release(*arguments: Any) -> Any:
        try:
            return compile_version(*arguments)
        except BaseException:
            lock.release()
            raise

    def save_and_release(signature: Any, result: Any) -> None:
        try:
            save(signature, result)
        finally:
            lock.release()

    cache.load_overload, cache.save_overload = load_or_wait, save_and_release
    compiler.compile = compile_or_release


class _Lock:
    """A lock file; where the disk has no locks, or after a while, a process goes on without."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: int | None = None

    def acquire(self) -> None:
        """Wait until no other process has the lock, and take it."""
        if self._file is not None:
            return
        try:
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:
            return
        end = time.monotonic() + _PATIENCE_S
        while time.monotonic() < end:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(_STEP_S)
            except OSError:
                return
            else:
                return

    def release(self) -> None:
        """Give the lock back, also where a process that was forked meanwhile has the file."""
        if self._file is not None:
            with suppress(OSError):
                fcntl.flock(self._file, fcntl.LOCK_UN)
            os.close(self._file)
            self._file = None
