"""SQLite files, opened so that nothing beside them is written."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import weakref
from pathlib import Path

from nanorocks_ros.errors import RecordingError

# What SQLite keeps beside a file until it is closed: what was written since (-wal), or what
# stood there before (-journal).
_BESIDE = ('-wal', '-journal')


class ReadOnly:
    """A SQLite file that is only read.

    Where a recorder was killed, a part of its recording stands in a file beside it. SQLite
    merges both when it opens them, and writes to their folder: so they are copied to a
    temporary one, which lasts as long as this object.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    size : int, [bytes]

    Raises
    ------
    RecordingError
        When there is no room for the copy.
    """

    def __init__(self, path: Path) -> None:
        # SQLite looks beside the file itself, not beside a link to it.
        path = path.resolve()
        beside = [path.with_name(f'{path.name}{ending}') for ending in _BESIDE]
        unmerged = [one for one in beside if one.is_file() and one.stat().st_size]
        self._uri = f'{path.as_uri()}?mode=ro&immutable=1'
        if unmerged:
            self._uri = self._copied(path, unmerged).as_uri()
        self.size = path.stat().st_size

    def _copied(self, path: Path, beside: list[Path]) -> Path:
        folder = tempfile.mkdtemp(prefix='nanorocks_')
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        try:
            for one in (path, *beside):
                shutil.copyfile(one, Path(folder) / one.name)
        except OSError as error:
            raise RecordingError(
                str(path),
                f'is read from a copy, as {beside[0].name} has to be merged into it; that cannot '
                f'be made in {tempfile.gettempdir()} ({error.strerror})',
                'make room there, or set TMPDIR to another folder',
            ) from error
        return Path(folder) / path.name

    def connect(self) -> sqlite3.Connection:
        """A connection to it, to be closed by whoever asked."""
        database = sqlite3.connect(self._uri, uri=True)
        # A name in which a bit is wrong must not cost the messages.
        database.text_factory = lambda raw: raw.decode('utf-8', 'replace')
        return database
