"""Finished parts of a long job, kept in a folder so that the job can be resumed."""

from __future__ import annotations

import hashlib
import json
import os
import re
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.folder_lock import LOCK, lock_folder
from nanorocks_ros.limits import require_regular_file
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import parse_object
from nanorocks_ros.outputs.npz_archive import Arrays, read_archive, write_archive
from nanorocks_ros.outputs.unfinished_files import delete_unfinished

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

SPECIFICATION, _FINGERPRINT = 'question.json', 'fingerprint'
_KEY = re.compile(r'[A-Za-z0-9][A-Za-z0-9_.-]*')


class Journal:
    """A folder of finished parts of one job.

    Every part is a file, written complete or not at all, with a fingerprint of the job. One
    process at a time may lock the folder.

    Parameters
    ----------
    folder : Path
        Made when it does not exist.
    specification : str
        JSON object with everything that the results depend on; it identifies the job.

    Raises
    ------
    RecordingError
        When the folder cannot be used, is locked by another process, or belongs to another job.
    """

    def __init__(self, folder: Path, specification: str) -> None:
        self.folder = folder
        self.notices: list[str] = []
        self._fingerprint = hashlib.sha256(specification.encode()).hexdigest()
        self._lock: int | None = lock_folder(folder)
        delete_unfinished(folder)
        try:
            self._check_specification(specification)
        except BaseException:
            self._unlock()
            raise

    def _check_specification(self, specification: str) -> None:
        path = self.folder / SPECIFICATION
        if not self.keys():
            write_bytes(path, specification.encode())
            return
        try:
            require_regular_file(path, RecordingError)
            earlier = path.read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            raise RecordingError(
                str(path), 'cannot be read', 'delete the folder, or pass another --output'
            ) from error
        if earlier != specification:
            raise RecordingError(
                str(self.folder),
                f'belongs to another job ({difference(earlier, specification)})',
                'delete the folder, or pass another --output',
            )

    def _paths(self) -> list[Path]:
        paths = self.folder.glob('*.npz')
        return sorted(path for path in paths if _KEY.fullmatch(path.name))

    def keys(self) -> list[str]:
        """Keys of the parts, whether they can be read or not."""
        return [path.stem for path in self._paths()]

    def newest_ns(self) -> int:
        """When the newest part was written, [ns]; 0 without parts."""
        return max((path.stat().st_mtime_ns for path in self._paths()), default=0)

    def intact_keys(self) -> list[str]:
        """Keys of the parts that can be read; deletes damaged parts and notes them in `notices`.

        Raises
        ------
        RecordingError
            For a part of another job.
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
            When the part cannot be read or belongs to another job.
        """
        path = self._path(key)
        try:
            arrays = read_archive(path)
        except RecordingError as error:
            raise _DamagedError(error.where, error.what, error.do) from error
        if str(arrays.pop(_FINGERPRINT, '')) != self._part_fingerprint(key):
            raise RecordingError(
                str(path), 'is a part of another job', 'delete it, or pass another --output'
            )
        return arrays

    def write(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write a part.

        Raises
        ------
        RecordingError
            When it cannot be written.
        """
        write_archive(
            self._path(key), {**arrays, _FINGERPRINT: np.array(self._part_fingerprint(key))}
        )

    def _part_fingerprint(self, key: str) -> str:
        # With the key: a renamed file does not count as another part.
        return f'{self._fingerprint} {key}'

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):
            raise RecordingError(
                str(self.folder), f'{key!r} cannot name a part', 'use letters, digits, - and _'
            )
        return self.folder / f'{key}.npz'

    def delete(self) -> None:
        """Delete the parts and unlock the folder; it stays if it holds anything else."""
        delete_unfinished(self.folder)
        for path in self._paths():
            path.unlink(missing_ok=True)
        (self.folder / SPECIFICATION).unlink(missing_ok=True)
        (self.folder / LOCK).unlink(missing_ok=True)
        with suppress(OSError):
            self.folder.rmdir()
        self._unlock()

    def close(self) -> None:
        """Unlock the folder; without parts it is deleted."""
        if self._lock is not None and not self.keys():
            self.delete()
        self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _DamagedError(RecordingError):
    """A part is damaged."""


def difference(actual: str, wanted: str) -> str:
    """The entries in which two JSON objects differ, as text.

    Parameters
    ----------
    actual, wanted : str
    """
    try:
        left, right = _flat(parse_object(actual)), _flat(parse_object(wanted))
    except (ValueError, RecursionError):
        return 'its specification cannot be read'
    names = [name for name in {**left, **right} if left.get(name) != right.get(name)]
    shown = [f'{name}: {_short(left.get(name))}, not {_short(right.get(name))}' for name in names]
    remainder = f' and {len(shown) - 3} more' if len(shown) > 3 else ''
    return '; '.join(shown[:3]) + remainder


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
