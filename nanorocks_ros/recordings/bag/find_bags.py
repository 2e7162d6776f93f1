"""Find recordings by paths, patterns and folders."""

from __future__ import annotations

import glob
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.bag_folder import ROS1_MAGIC, STORAGE_SUFFIXES
from nanorocks_ros.recordings.film.natural_sort import SYSTEM_FOLDERS, natural_key
from nanorocks_ros.recordings.mcap.mcap_blocks import MAGIC
from nanorocks_ros.recordings.sqlite.sqlite_file import MAGIC as SQLITE_MAGIC

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

RESULTS_MARK = '.nanorocks_results'
"""File that marks a folder of analysis results."""

_MAGIC = MAGIC, ROS1_MAGIC, SQLITE_MAGIC
_METADATA = 'metadata.yaml'
# ROS 1 bags are included: the reader reports how to convert them.
_SUFFIXES = {*STORAGE_SUFFIXES, '.bag'}
# Number of a file in a split recording.
_SPLIT = re.compile(r'_\d+$')


@dataclass(slots=True, kw_only=True)
class FoundBags:
    """Recordings found by `find_bags`.

    Parameters
    ----------
    bags : list of Path
        Without duplicates; those of a pattern or a folder are sorted naturally.
    missing : dict of str to RecordingError
        Inputs without a recording, and the reason.
    left_out : list of str
        Paths in patterns and folders that were skipped, each with the reason.
    """

    bags: list[Path] = field(default_factory=list)
    missing: dict[str, RecordingError] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def is_pattern(text: str) -> bool:
    """Whether a text is a glob pattern and not the name of an existing file."""
    return glob.has_magic(text) and not os.path.lexists(text)


def is_collection(path: Path) -> bool:
    """Whether a path is a folder that contains recordings and is not a recording itself."""
    try:
        return path.is_dir() and not _is_bag(path) and bool(_recordings_in(path, FoundBags()))
    except OSError:
        return False


def is_recording(path: Path) -> bool:
    """Whether a path is a bag or a storage file, whole or not.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    return _is_bag(path) if path.is_dir() else _is_storage(path)


def find_bags(inputs: Sequence[str]) -> FoundBags:
    """Find the recordings that the inputs refer to.

    Parameters
    ----------
    inputs : sequence of str
        Recordings, folders of recordings, or patterns such as ``bags/*``.
    """
    result = FoundBags()
    for text in inputs:
        if is_pattern(text):
            matches = sorted(map(Path, glob.glob(text, recursive=True)), key=_natural_order)
            if not matches:
                result.missing[text] = RecordingError(
                    text, 'matches nothing', 'correct the pattern, and quote it for the shell'
                )
        elif os.path.lexists(text):
            matches = [Path(text)]
        else:
            result.missing[text] = RecordingError(text, 'does not exist', 'name a recording')
            continue
        for path in matches:
            result.bags += _bags_at(path, result)
    result.bags = _without_duplicates(result.bags)
    return result


def _bags_at(path: Path, result: FoundBags) -> list[Path]:
    """Recordings at a path that the user named."""
    try:
        if path.is_dir():
            if (path / RESULTS_MARK).exists():
                result.left_out.append(f'{path}: holds results')
                return []
            # An empty folder is a recording that never started: the reader reports it.
            return [path] if _is_bag(path) else _recordings_in(path, result) or [path]
        if path.is_file() and not _is_storage(path):
            result.left_out.append(f'{path}: is not a recording')
            return []
    except OSError:
        # The reader reports why the path cannot be read.
        pass
    return [path]


def _recordings_in(folder: Path, result: FoundBags) -> list[Path]:
    """Recordings in a folder and its subfolders; other files are skipped without a notice."""
    bags = []
    for path in sorted(folder.iterdir(), key=_natural_order):
        if path.name.startswith('.') or path.name in SYSTEM_FOLDERS:
            continue
        try:
            bags += _recordings_at(path, result)
        except OSError as error:
            # An unreadable folder may contain recordings; the others are still read.
            result.missing[str(path)] = RecordingError(
                str(path), f'cannot be read ({error.strerror})', 'make it readable'
            )
    return bags


def _recordings_at(path: Path, result: FoundBags) -> list[Path]:
    """Recordings at a path inside a folder."""
    if path.is_dir() and not path.is_symlink():
        if (path / RESULTS_MARK).exists():
            result.left_out.append(f'{path}: holds results')
            return []
        return [path] if _is_bag(path) else _recordings_in(path, result)
    is_file = path.suffix in _SUFFIXES
    return [path] if is_file or (path.is_dir() and _is_bag(path)) else []


def _is_bag(folder: Path) -> bool:
    """Whether a folder has metadata.yaml or, as after a crash, numbered files of one name."""
    if (folder / _METADATA).exists():
        return True
    entries = list(folder.iterdir())
    stems = {_SPLIT.sub('', path.stem) for path in entries if path.suffix in STORAGE_SUFFIXES}
    # A storage file next to rosbag2 folders is a recording itself.
    return len(stems) == 1 and not any((path / _METADATA).exists() for path in entries)


def _is_storage(path: Path) -> bool:
    if path.suffix in _SUFFIXES:
        return True
    try:
        with path.open('rb') as stream:
            start = stream.read(max(len(magic) for magic in _MAGIC))
    except OSError:
        return True
    return start.startswith(_MAGIC)


def _without_duplicates(paths: Iterable[Path]) -> list[Path]:
    """Remove further names of a recording, and files of a folder that is listed as well."""
    by_target = {path.resolve(): path for path in reversed(list(paths))}
    kept = [(target, path) for target, path in by_target.items() if target.parent not in by_target]
    return [path for _, path in reversed(kept)]


def _natural_order(path: Path) -> list[list[tuple[int, str]]]:
    return [natural_key(part) for part in path.parts]
