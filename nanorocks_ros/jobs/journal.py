"""What is done of a long job, kept beside its output so that the job can go on later."""

from __future__ import annotations

import hashlib
import json
import os
import re
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.folder_lock import LOCK, hold_folder
from nanorocks_ros.outputs.atomic_files import write_whole
from nanorocks_ros.outputs.npz_archive import Arrays, read_archive, write_archive

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

QUESTION, _FINGERPRINT = 'question.json', 'fingerprint'
_KEY = re.compile(r'[A-Za-z0-9][A-Za-z0-9_.-]*')


class Journal:
    """A folder of finished parts of one job.

    Every part is a file, written complete or not at all, and bears the fingerprint of the
    question it answers. One process at a time may hold the folder.

    Parameters
    ----------
    folder : Path
        Made when it is not there.
    question : str
        A JSON object: everything that the results depend on.

    Raises
    ------
    RecordingError
        When the folder cannot be used, is held by another process, or belongs to another
        question.
    """

    def __init__(self, folder: Path, question: str) -> None:
        self.folder = folder
        self.notices: list[str] = []
        self._fingerprint = hashlib.sha256(question.encode()).hexdigest()
        self._lock: int | None = hold_folder(folder)
        try:
            self._check_question(question)
        except BaseException:
            self._let_go()
            raise

    def _check_question(self, question: str) -> None:
        path = self.folder / QUESTION
        if not self.keys():
            write_whole(path, question.encode())
            return
        try:
            found = path.read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            raise RecordingError(
                str(path), 'cannot be read', 'delete the folder, or pass another --output'
            ) from error
        if found != question:
            raise RecordingError(
                str(self.folder),
                f'belongs to another job ({difference(found, question)})',
                'delete the folder, or pass another --output',
            )

    def _paths(self) -> list[Path]:
        paths = self.folder.glob('*.npz')
        return sorted(path for path in paths if _KEY.fullmatch(path.name))

    def keys(self) -> list[str]:
        """Keys of the parts there are, unread."""
        return [path.stem for path in self._paths()]

    def good_keys(self) -> list[str]:
        """Keys of the finished parts that can be read; damaged ones are deleted, and told.

        Raises
        ------
        RecordingError
            For a part of another question.
        """
        good = []
        for key in self.keys():
            try:
                self.read(key)
            except _DamagedError:
                path = self._path(key)
                self.notices.append(f'{path}: is damaged; it is made again')
                path.unlink(missing_ok=True)
            else:
                good.append(key)
        return good

    def read(self, key: str) -> Arrays:
        """The arrays of a part.

        Raises
        ------
        RecordingError
            When the part cannot be read or belongs to another question.
        """
        path = self._path(key)
        try:
            arrays = read_archive(path)
        except RecordingError as error:
            raise _DamagedError(error.where, error.what, error.do) from error
        if str(arrays.pop(_FINGERPRINT, '')) != self._mark(key):
            raise RecordingError(
                str(path), 'is a part of another job', 'delete it, or pass another --output'
            )
        return arrays

    def write(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep a part.

        Raises
        ------
        RecordingError
            When it cannot be written.
        """
        write_archive(self._path(key), {**arrays, _FINGERPRINT: np.array(self._mark(key))})

    def _mark(self, key: str) -> str:
        # With the key: a file that was renamed is another part.
        return f'{self._fingerprint} {key}'

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):
            raise RecordingError(
                str(self.folder), f'{key!r} cannot name a part', 'use letters, digits, - and _'
            )
        return self.folder / f'{key}.npz'

    def delete(self) -> None:
        """Delete the parts and let go of the folder; if it holds anything else it stays."""
        for path in self._paths():
            path.unlink(missing_ok=True)
        (self.folder / QUESTION).unlink(missing_ok=True)
        (self.folder / LOCK).unlink(missing_ok=True)
        with suppress(OSError):
            self.folder.rmdir()
        self._let_go()

    def close(self) -> None:
        """Let another process use the folder; without parts it is deleted."""
        if self._lock is not None and not self.keys():
            self.delete()
        self._let_go()

    def _let_go(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _DamagedError(RecordingError):
    """A part whose bytes are not those that were written."""


def difference(found: str, wanted: str) -> str:
    """In which entries two JSON objects differ, for people.

    Parameters
    ----------
    found, wanted : str
    """
    try:
        one, other = json.loads(found), json.loads(wanted)
    except ValueError:
        return 'its question cannot be read'
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return 'its question cannot be read'
    one, other = _flat(one), _flat(other)
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    shown = [f'{name}: {_short(one.get(name))}, not {_short(other.get(name))}' for name in names]
    more = f' and {len(shown) - 3} more' if len(shown) > 3 else ''
    return '; '.join(shown[:3]) + more


def _flat(tree: dict[str, Any], prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            flat.update(_flat(value, f'{prefix}{name}.'))
        else:
            flat[prefix + name] = value
    return flat


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else f'{text[:37]}...'
