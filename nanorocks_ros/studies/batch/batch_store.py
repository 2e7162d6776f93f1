"""The folder of the results of a batch, and its manifest.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.folder_lock import lock_folder
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.outputs.safe_text import printable
from nanorocks_ros.outputs.unfinished_files import holds_files
from nanorocks_ros.recordings.bag.fingerprint import file_states, total_size
from nanorocks_ros.settings import rows
from nanorocks_ros.studies.analysis.results.results_folder import SUMMARY
from nanorocks_ros.studies.batch.bag_summary import DONE, PARTIAL, read_summary
from nanorocks_ros.studies.batch.batch_task import BagOutcome, BagTask
from nanorocks_ros.studies.batch.manifest_entries import (
    BAGS,
    Entry,
    entry_as_json,
    entry_from_json,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from nanorocks_ros.settings import PipelineSettings

MANIFEST = 'manifest.json'
_MARK, _NOTES = '.nanorocks_batch', '.under_way'
_WAITING = 'waiting'
# Of the name of a folder, of the 255 bytes that file systems take.
_LONGEST_NAME = 150

# What reading a manifest raises that holds other types and values.
_WRONG_CONTENT = (
    OSError,
    ValueError,
    OverflowError,
    LookupError,
    TypeError,
    AttributeError,
    RecordingError,
)


class BatchStore:
    """Results of many recordings, each in a folder of its own, held by one process at a time.

    Parameters
    ----------
    folder : Path
        New, empty, or that of an earlier batch.
    settings : PipelineSettings
    image_topic : str
    told : frozenset of str or None
        As in `BagTask`.
    statistics : bool
        As in `BagTask`.

    Attributes
    ----------
    notices : list of str

    Raises
    ------
    RecordingError
        When the folder holds something else, is in use, or cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        settings: PipelineSettings,
        image_topic: str,
        told: frozenset[str] | None = None,
        *,
        statistics: bool = False,
    ) -> None:
        self.folder = folder.absolute()
        self.notices: list[str] = []
        self._settings, self._image_topic, self._told = settings, image_topic, told
        self._statistics = statistics
        self._question = _question(settings, image_topic, told)
        if statistics:
            self._question += '-statistics'
        self.entries: dict[Path, Entry] = {}
        self._by_task: dict[str, Entry] = {}
        self._check_place()
        self._lock = lock_folder(self.folder, _MARK)
        try:
            self._known = self._read()
            for name in (BAGS, _NOTES):
                (self.folder / name).mkdir(exist_ok=True)
            self._sweep()
        except OSError as error:
            os.close(self._lock)
            raise RecordingError(
                str(folder), f'cannot be written ({error.strerror})', 'pass another --output'
            ) from error

    def __enter__(self) -> BatchStore:
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self.folder / _NOTES, ignore_errors=True)
        os.close(self._lock)

    def _check_place(self) -> None:
        try:
            has_files = self.folder.exists() and holds_files(self.folder)
        except OSError as error:
            raise RecordingError(
                str(self.folder), f'cannot be read ({error.strerror})', 'pass another --output'
            ) from error
        if has_files and not (self.folder / _MARK).is_file():
            raise RecordingError(
                str(self.folder), 'exists and holds no batch of ours', 'pass another --output'
            )

    def _sweep(self) -> None:
        """Remove the leftovers of killed workers."""
        for path in (*(self.folder / BAGS).glob('.*'), *(self.folder / _NOTES).iterdir()):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)

    def place(self, entry: Entry) -> Path:
        """The folder of the results of a recording."""
        return self.folder / BAGS / entry.folder

    def add(self, bags: Sequence[Path]) -> dict[str, BagTask]:
        """Add recordings to the batch.

        Parameters
        ----------
        bags : sequence of Path

        Returns
        -------
        dict of str to BagTask
            The recordings left to analyse, by name of the folder; finished recordings are
            left out if they have not changed since.
        """
        taken = {entry.folder.casefold(): path for path, entry in self._known.items()}
        tasks: dict[str, BagTask] = {}
        for bag in bags:
            path = bag.absolute()
            before = self._known.get(path)
            name = before.folder if before else _free_name(path, taken)
            taken[name.casefold()] = path
            entry = Entry(path=path, folder=name, outcome=BagOutcome(state=_WAITING))
            self.entries[path] = entry
            if before is not None and self._untouched(before):
                entry.outcome = before.outcome
                continue
            tasks[name] = BagTask(
                path=path,
                folder=self.place(entry),
                settings=self._settings,
                image_topic=self._image_topic,
                question=self._question,
                note=self.folder / _NOTES / name,
                earlier=() if before else self._gone(path),
                told=self._told,
                statistics=self._statistics,
            )
            self._by_task[name] = entry
        return tasks

    def _gone(self, path: Path) -> tuple[Path, ...]:
        """Results of missing recordings of the same size, which may be this one, moved."""
        try:
            size = total_size(file_states(path))
        except OSError:
            return ()
        return tuple(
            self.place(entry)
            for entry in self._known.values()
            if total_size(entry.outcome.files) == size and not os.path.lexists(entry.path)
        )

    def _untouched(self, before: Entry) -> bool:
        outcome = before.outcome
        if outcome.state not in (DONE, PARTIAL):
            return False
        summary = read_summary(self.place(before))
        if summary is None:
            return False
        try:
            is_unchanged = file_states(before.path) == outcome.files
        except OSError:
            return False
        stored = summary['content'], summary['question']
        return is_unchanged and stored == (outcome.content, self._question)

    def finish(self, name: str, outcome: BagOutcome) -> None:
        """Note the outcome of a recording."""
        entry = self._by_task[name]
        entry.outcome = outcome
        if outcome.folder:
            entry.folder = outcome.folder
            stale_paths = [
                path for path, previous in self._known.items() if previous.folder == outcome.folder
            ]
            for path in stale_paths:
                del self._known[path]

    def under_way(self) -> dict[str, tuple[int, int]]:
        """Frames done and total of the recordings being analysed, by folder."""
        frames = {}
        for note in (self.folder / _NOTES).glob('*'):
            with suppress(OSError, ValueError):
                done, total = (int(word) for word in note.read_text('ascii').split())
                frames[note.name] = done, total
        return frames

    def write(self) -> None:
        """Write the manifest, including recordings of earlier calls that are not in this one.

        Raises
        ------
        RecordingError
            When it cannot be written.
        """
        content = {
            'format': 1,
            'nanorocks_ros': __version__,
            'image_topic': self._image_topic,
            'settings': {row.name: row.default for row in rows(self._settings)},
            'bags': [entry_as_json(entry) for entry in {**self._known, **self.entries}.values()],
        }
        write_bytes(self.folder / MANIFEST, json.dumps(content, indent=1).encode())

    def _read(self) -> dict[Path, Entry]:
        path = self.folder / MANIFEST
        try:
            content = read_object(path)
            return {entry.path: entry for entry in map(entry_from_json, content['bags'])}
        except FileNotFoundError:
            return {}
        except _WRONG_CONTENT:
            self.notices.append(f'{path}: is damaged; recordings are looked at anew')
            return self._from_folders()

    def _from_folders(self) -> dict[Path, Entry]:
        entries = {}
        for place in sorted((self.folder / BAGS).glob(f'*/{SUMMARY}')):
            summary = read_summary(place.parent)
            if summary is not None:
                path = Path(summary['bag'])
                outcome = BagOutcome(state=_WAITING)
                entries[path] = Entry(path=path, folder=place.parent.name, outcome=outcome)
        return entries


def _question(settings: PipelineSettings, image_topic: str, told: frozenset[str] | None) -> str:
    """A hash of all that the results depend on besides the recording."""
    digest = hashlib.blake2b(digest_size=16)
    for row in rows(settings):
        digest.update(f'{row.name}={row.default!r}\n'.encode(errors='surrogateescape'))
        if isinstance(row.default, str) and row.default and Path(row.default).is_file():
            # The content of a file may change under the same name.
            with suppress(OSError):
                digest.update(Path(row.default).read_bytes())
    names = None if told is None else sorted(told)
    digest.update(f'{__version__} {image_topic} {names}'.encode(errors='surrogateescape'))
    return digest.hexdigest()


def _free_name(path: Path, taken: Iterable[str]) -> str:
    """The name of the recording, and a number where another recording has that name."""
    name = path.stem if path.suffix in {'.mcap', '.db3', '.bag'} else path.name
    name = re.sub(r'[^\w.,+=@ -]', '_', printable(name)).strip('. ') or 'recording'
    name = name.encode()[:_LONGEST_NAME].decode(errors='ignore')
    number, free = 1, name
    while free.casefold() in taken:
        number += 1
        free = f'{name}-{number}'
    return free
