"""Open the storage files of a rosbag2 folder, or a single storage file, and read its metadata.

Tested by ``test/recordings/bag/test_find_bags.py``.
"""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.yaml_limits import load_yaml
from nanorocks_ros.experiment.yaml_lines import read_text
from nanorocks_ros.limits import require_regular_file
from nanorocks_ros.recordings.film.natural_sort import natural_key
from nanorocks_ros.recordings.mcap import mcap_blocks
from nanorocks_ros.recordings.mcap.mcap_file import McapFile
from nanorocks_ros.recordings.sqlite import sqlite_file
from nanorocks_ros.recordings.sqlite.sqlite_file import SqliteFile
from nanorocks_ros.recordings.storage import StorageFile

_KINDS = 'a rosbag2 folder or an .mcap file; commands that measure take films as well'
METADATA = 'metadata.yaml'
ROS1_MAGIC = b'#ROSBAG V'
# Missing files that are named.
_NAMED_FILES = 5
STORAGE_SUFFIXES = frozenset({'.mcap', '.db3'})


@dataclass(frozen=True, slots=True, kw_only=True)
class BagContents:
    """Open storage files and metadata of a recording.

    Parameters
    ----------
    files : tuple of StorageFile
        At least one.
    metadata : dict of str to str
        Provenance (``custom_data``).
    compressed_messages : bool
        Whether each message is compressed separately (zstd).
    notices : tuple of str
        Problems with the folder, in sentences.
    complete : bool
        Whether all files are present and readable.
    expected : int or None
        Number of messages according to the recorder; None if it is not stated.
    """

    files: tuple[StorageFile, ...]
    metadata: dict[str, str]
    compressed_messages: bool
    notices: tuple[str, ...]
    complete: bool
    expected: int | None = None


def open_contents(path: Path, *, salvaging: bool = False) -> BagContents:
    """Open all storage files at a path and read the metadata.

    Parameters
    ----------
    path : Path
    salvaging : bool
        Open files whose first bytes are damaged, too.

    Returns
    -------
    BagContents

    Raises
    ------
    RecordingError
        If nothing exists at the path, or it is not a recording.
    """
    try:
        if not path.exists():
            raise RecordingError(str(path), 'does not exist', f'pass {_KINDS}')
        if path.is_dir():
            return _folder(path, salvaging)
        file = _open_file(path, salvaging)
        information = _recorder_notes([file])
        return BagContents(
            files=(file,),
            metadata=_provenance(information),
            compressed_messages=_are_messages_compressed(information),
            notices=(),
            complete=True,
        )
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'check its permissions'
        ) from error


def read_metadata(path: str | Path) -> dict[str, str]:
    """Provenance of a recording, without its messages where ``metadata.yaml`` is there.

    Raises
    ------
    RecordingError
        If nothing exists at the path, or it is not a recording.
    """
    path = Path(path)
    if path.is_dir() and (information := _information(path, [])):
        return _provenance(information)
    return open_contents(path).metadata


def _open_file(path: Path, salvaging: bool) -> StorageFile:
    require_regular_file(path, RecordingError)
    with path.open('rb') as stream:
        start = stream.read(16)
    if not start:
        raise RecordingError(
            str(path), 'is empty (0 bytes)', 'record it again or pass another bag'
        )
    if start.startswith(ROS1_MAGIC):
        raise RecordingError(
            str(path),
            'is a ROS 1 bag',
            f'convert it first: {shlex.join(_conversion(path))}',
        )
    if start == sqlite_file.MAGIC:
        return SqliteFile(path)
    if path.suffix == '.mcap' or start.startswith(mcap_blocks.MAGIC):
        return McapFile(path, salvaging=salvaging)
    raise RecordingError(str(path), 'is not a bag', f'pass {_KINDS}')


def _conversion(path: Path) -> list[str]:
    """Command that converts a ROS 1 bag to a ROS 2 recording in the same folder."""
    target = path.with_suffix('')
    # The converter chooses the format by the ending of its target and overwrites nothing.
    if target.suffix == '.bag' or target.exists():
        target = path.with_name(f'{path.stem.removesuffix(".bag")}_ros2')
    return ['rosbags-convert', '--src', str(path), '--dst', str(target)]


def _folder(path: Path, salvaging: bool) -> BagContents:
    notices: list[str] = []
    information = _information(path, notices)
    names = _names(path, information)
    if not names:
        raise RecordingError(
            str(path), 'is a folder without any .mcap or .db3 file', f'pass {_KINDS}'
        )
    _refuse_compressed_files(path, information)
    files = _open_files(path, names, notices, salvaging)
    count = information.get('message_count')
    notes = _recorder_notes(files)
    if (
        len(files) == 1
        and information
        and notes
        and _provenance(notes) != _provenance(information)
    ):
        notices.append(
            f'{path / METADATA}: its provenance differs from the copy in {files[0].path.name}; '
            'the former is used'
        )
    information = information or notes
    return BagContents(
        files=tuple(files),
        metadata=_provenance(information),
        compressed_messages=_are_messages_compressed(information),
        notices=tuple(notices),
        complete=len(files) == _count_of_files(path, names),
        expected=count if type(count) is int and count >= 0 else None,
    )


def _provenance(information: dict[str, Any]) -> dict[str, str]:
    custom = information.get('custom_data') or {}
    return {str(k): str(v) for k, v in custom.items()} if isinstance(custom, dict) else {}


def _are_messages_compressed(information: dict[str, Any]) -> bool:
    return str(information.get('compression_mode') or '').lower() == 'message'


def _recorder_notes(files: list[StorageFile]) -> dict[str, Any]:
    """Copy of metadata.yaml in the storage files; empty if none has one."""
    for file in files:
        try:
            notes = load_yaml(str(file.path), file.recorder_notes)
        except ConfigurationError:
            continue
        if isinstance(notes, dict):
            return notes
    return {}


def _information(path: Path, notices: list[str]) -> dict[str, Any]:
    file = path / METADATA
    if not os.path.lexists(file):
        notices.append(
            f'{path}: has no metadata.yaml, as after a crash; the bag is read without it'
        )
        return {}
    try:
        document = load_yaml(str(file), read_text(file, 'a rosbag2 folder'))
        return dict(document['rosbag2_bagfile_information'])
    except (KeyError, TypeError, ValueError):
        notices.append(f'{file}: cannot be parsed; the bag is read without it')
    except ConfigurationError as error:
        notices.append(f'{file}: cannot be parsed ({error.what}); the bag is read without it')
    return {}


def _names(path: Path, information: dict[str, Any]) -> list[str]:
    listed = information.get('relative_file_paths')
    # Early versions of rosbag2 listed paths that start with the folder.
    names = [PurePath(str(name)).name for name in listed] if isinstance(listed, list) else []
    # A file that is listed twice is one file.
    names = list(dict.fromkeys(names))
    if any((path / name).is_file() for name in names):
        return names
    present = (p.name for p in path.iterdir() if p.suffix in STORAGE_SUFFIXES and p.is_file())
    return sorted(present, key=natural_key)


def _refuse_compressed_files(path: Path, information: dict[str, Any]) -> None:
    if str(information.get('compression_mode') or '').lower() == 'file':
        raise RecordingError(
            str(path),
            "holds storage files that are compressed as a whole (compression_mode 'file')",
            'unpack them with `zstd -d` and delete metadata.yaml',
        )


def _count_of_files(path: Path, names: list[str]) -> int:
    """Number of files that a recording should have: a second name of a file does not count."""
    present = [(path / name).stat() for name in names if (path / name).is_file()]
    missing = len(names) - len(present)
    return missing + len({(status.st_dev, status.st_ino) for status in present})


def _open_files(
    path: Path, names: list[str], notices: list[str], salvaging: bool
) -> list[StorageFile]:
    files: list[StorageFile] = []
    errors: list[RecordingError] = []
    missing = [name for name in names if not (path / name).is_file()]
    notices += [f'{path / name}: is missing' for name in missing[:_NAMED_FILES]]
    if len(missing) > _NAMED_FILES:
        notices.append(f'{path}: {len(missing) - _NAMED_FILES} more of its files are missing')
    known: dict[tuple[int, int], str] = {}
    absent = frozenset(missing)
    for name in names:
        if name in absent:
            continue
        status = (path / name).stat()
        other = known.setdefault((status.st_dev, status.st_ino), name)
        if other != name:
            notices.append(f'{path / name}: is {other} under another name; it is read once')
            continue
        try:
            files.append(_open_file(path / name, salvaging))
        except RecordingError as error:
            errors.append(error)
    if not files:
        raise errors[0]
    notices += [f'{error.where}: {error.what}' for error in errors]
    return files
