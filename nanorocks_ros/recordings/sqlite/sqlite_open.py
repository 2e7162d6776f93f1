"""Read-only access to SQLite files without writing to their folder.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import weakref
from pathlib import Path

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import SQLITE_STEPS

_STEPS_AT_ONCE = 100_000
# Companion files of an open SQLite file: changes not merged yet (-wal), or the previous content
# (-journal).
_COMPANIONS = ('-wal', '-journal')


class ReadOnlyDatabase:
    """A SQLite file that is only read.

    If a recorder was killed, a part of its recording is in a companion file. SQLite merges both
    when it opens them and writes to their folder. Therefore such files are copied to a temporary
    folder, which exists as long as this object.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    size : int, [bytes]

    Raises
    ------
    RecordingError
        If there is no room for the copy.
    """

    def __init__(self, path: Path) -> None:
        # SQLite looks for companions of the file itself, not of a link to it.
        path = path.resolve()
        companions = [path.with_name(f'{path.name}{ending}') for ending in _COMPANIONS]
        unmerged = [file for file in companions if file.is_file() and file.stat().st_size]
        self._uri = f'{path.as_uri()}?mode=ro&immutable=1'
        if unmerged:
            self._uri = self._copied(path, unmerged).as_uri()
        self.size = path.stat().st_size

    def _copied(self, path: Path, companions: list[Path]) -> Path:
        folder = tempfile.mkdtemp(prefix='nanorocks_')
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        try:
            for file in (path, *companions):
                shutil.copyfile(file, Path(folder) / file.name)
        except OSError as error:
            raise RecordingError(
                str(path),
                f'must be copied to merge {companions[0].name} into it, but the copy cannot be '
                f'written to {tempfile.gettempdir()} ({error.strerror})',
                'make room there, or set TMPDIR to another folder',
            ) from error
        return Path(folder) / path.name

    def _bound_steps(self, database: sqlite3.Connection) -> None:
        """Stop queries that would never end."""
        left = SQLITE_STEPS.value

        def use_steps() -> int:
            nonlocal left
            left -= _STEPS_AT_ONCE
            return int(left < 0)

        database.set_progress_handler(use_steps, _STEPS_AT_ONCE)

    def connect(self) -> sqlite3.Connection:
        """Open a connection; the caller closes it."""
        database = sqlite3.connect(self._uri, uri=True)
        # Views and triggers of a file must not run functions; the rest is bounded by its size.
        database.execute('PRAGMA trusted_schema=OFF')
        self._bound_steps(database)
        # A flipped bit in a name must not make the messages unreadable.
        database.text_factory = lambda raw: raw.decode('utf-8', 'replace')
        return database
