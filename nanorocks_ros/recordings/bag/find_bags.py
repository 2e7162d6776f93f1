"""The recordings behind paths, patterns and folders of many."""

from __future__ import annotations

import glob
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.bag_folder import ROS1_MAGIC, STORAGE_SUFFIXES
from nanorocks_ros.recordings.film.natural_sort import OF_THE_DISK, natural
from nanorocks_ros.recordings.mcap.mcap_blocks import MAGIC
from nanorocks_ros.recordings.sqlite.sqlite_file import MAGIC as SQLITE_MAGIC

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

RESULTS_MARK = '.nanorocks_results'
"""File that marks a folder of analysis results."""

_MAGIC = MAGIC, ROS1_MAGIC, SQLITE_MAGIC
_METADATA = 'metadata.yaml'
# Of ROS 1 as well: whoever reads one says what to do with it.
_RECORDINGS = {*STORAGE_SUFFIXES, '.bag'}
_SPLIT = re.compile(r'_\d+$')


@dataclass(slots=True, kw_only=True)
class FoundBags:
    """What there is to read.

    Parameters
    ----------
    bags : list of Path
        Each once; those of a pattern or a folder sorted, numbers by their value.
    missing : dict of str to RecordingError
        Inputs behind which there is nothing, and why.
    left_out : list of str
        What patterns and folders hold besides recordings.
    """

    bags: list[Path] = field(default_factory=list)
    missing: dict[str, RecordingError] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def is_pattern(text: str) -> bool:
    """Whether it is a pattern, and no file that is called so."""
    return glob.has_magic(text) and not os.path.lexists(text)


def is_collection(path: Path) -> bool:
    """Whether it is a folder that holds recordings, and is none itself."""
    try:
        return path.is_dir() and not _is_bag(path) and bool(_inside(path, FoundBags()))
    except OSError:
        return False


def find_bags(inputs: Sequence[str]) -> FoundBags:
    """The recordings that some inputs name.

    Parameters
    ----------
    inputs : sequence of str
        Recordings, folders of recordings, or patterns such as ``bags/*``.
    """
    found = FoundBags()
    for text in inputs:
        if is_pattern(text):
            matches = sorted(map(Path, glob.glob(text, recursive=True)), key=_in_order)
            if not matches:
                found.missing[text] = RecordingError(
                    text, 'matches nothing', 'correct the pattern, and quote it for the shell'
                )
        elif os.path.lexists(text):
            matches = [Path(text)]
        else:
            found.missing[text] = RecordingError(text, 'does not exist', 'name a recording')
            continue
        for path in matches:
            found.bags += _bags_at(path, found)
    found.bags = _each_once(found.bags)
    return found


def _bags_at(path: Path, found: FoundBags) -> list[Path]:
    try:
        if path.is_dir():
            if (path / RESULTS_MARK).exists():
                found.left_out.append(f'{path}: holds results')
                return []
            # A folder of nothing is a recording that never began: it is told with the others.
            return [path] if _is_bag(path) else _inside(path, found) or [path]
        if path.is_file() and not _is_storage(path):
            found.left_out.append(f'{path}: is no recording')
            return []
    except OSError:
        # Whoever reads it says why it cannot be read.
        pass
    return [path]


def _inside(folder: Path, found: FoundBags) -> list[Path]:
    """Recordings in a folder and in its folders; what else there is, is nobody's concern."""
    bags = []
    for path in sorted(folder.iterdir(), key=_in_order):
        if path.name.startswith('.') or path.name in OF_THE_DISK:
            continue
        try:
            bags += _recordings_at(path, found)
        except OSError as error:
            # There may be recordings in it; those beside it are read all the same.
            found.missing[str(path)] = RecordingError(
                str(path), f'cannot be read ({error.strerror})', 'make it readable'
            )
    return bags


def _recordings_at(path: Path, found: FoundBags) -> list[Path]:
    if path.is_dir() and not path.is_symlink():
        if (path / RESULTS_MARK).exists():
            found.left_out.append(f'{path}: holds results')
            return []
        return [path] if _is_bag(path) else _inside(path, found)
    is_file = path.suffix in _RECORDINGS
    return [path] if is_file or (path.is_dir() and _is_bag(path)) else []


def _is_bag(folder: Path) -> bool:
    """A rosbag2 folder, or what a crash left of one: files of one name and their numbers."""
    if (folder / _METADATA).exists():
        return True
    inside = list(folder.iterdir())
    stems = {_SPLIT.sub('', path.stem) for path in inside if path.suffix in STORAGE_SUFFIXES}
    # Beside recordings in folders, a file is a recording of its own.
    return len(stems) == 1 and not any((path / _METADATA).exists() for path in inside)


def _is_storage(path: Path) -> bool:
    if path.suffix in _RECORDINGS:
        return True
    try:
        with path.open('rb') as stream:
            start = stream.read(max(len(one) for one in _MAGIC))
    except OSError:
        return True
    return start.startswith(_MAGIC)


def _each_once(paths: Iterable[Path]) -> list[Path]:
    """Without a second name of one, and without files of folders that are there as well."""
    by_place = {path.resolve(): path for path in reversed(list(paths))}
    kept = [(place, path) for place, path in by_place.items() if place.parent not in by_place]
    return [path for _, path in reversed(kept)]


def _in_order(path: Path) -> list[list[tuple[int, str]]]:
    return [natural(part) for part in path.parts]
