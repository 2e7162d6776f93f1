"""Output files: checked before the work, written complete or not at all."""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError, NanorocksError, RecordingError
from nanorocks_ros.outputs.unfinished_files import open_unfinished

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


def check_outputs(
    files: Mapping[str, Path], kinds: Mapping[str, tuple[str, ...]], *, force: bool = False
) -> None:
    """Raise for files that could not be written, before hours of work.

    Parameters
    ----------
    files : mapping of str to Path
        Files by the flag that names them.
    kinds : mapping of str to tuple of str
        Suffixes that a flag accepts; a flag that is not listed names a new folder.
    force : bool
        Whether existing files (not folders) may be replaced.

    Raises
    ------
    ConfigurationError
        For an unknown suffix, or two flags with the same file.
    RecordingError
        For a file that exists, or cannot be created.
    """
    flags: dict[Path, str] = {}
    for flag, path in files.items():
        if flag in kinds and path.suffix not in kinds[flag]:
            raise ConfigurationError(
                flag, f'{path} ends in none of {", ".join(kinds[flag])}', 'name such a file'
            )
        target = path.resolve()
        if target in flags:
            raise ConfigurationError(
                flag, f'names the file of {flags[target]}, {path}', 'name another'
            )
        flags[target] = flag
    for flag, path in files.items():
        _check_target(path, folder=flag not in kinds, force=force)


def _check_target(path: Path, *, folder: bool, force: bool) -> None:
    if os.path.lexists(path) and (folder or path.is_dir()):
        raise RecordingError(str(path), 'exists already and is not overwritten', 'name another')
    if os.path.lexists(path) and not force:
        raise RecordingError(
            str(path), 'exists already and is not overwritten', 'name another, or add --force'
        )
    if folder:
        check_new_folder(path)
        return
    if not path.parent.is_dir():
        raise RecordingError(
            str(path), f'there is no folder {path.parent}', 'make it, or write elsewhere'
        )
    if not os.access(path.parent, os.W_OK):
        raise RecordingError(
            str(path), f'the folder {path.parent} cannot be written to', 'write elsewhere'
        )
    _check_names(path.parent, path)
    _try_to_write(path.parent, path)


def _check_names(folder: Path, path: Path) -> None:
    """Raise for names that are longer than the file system of a folder takes."""
    longest = os.pathconf(folder, 'PC_NAME_MAX')
    for name in path.parts:
        if len(os.fsencode(name)) > longest:
            raise RecordingError(
                str(path),
                f'a name in it has {len(os.fsencode(name))} bytes',
                f'use at most {longest}',
            )


def _try_to_write(folder: Path, path: Path) -> None:
    """Raise where no file can be made, whatever the permissions say."""
    try:
        part, lock = open_unfinished(folder / path.name)
        part.unlink(missing_ok=True)
        os.close(lock)
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be written ({error.strerror})', 'write elsewhere'
        ) from error


def check_new_folder(path: Path) -> None:
    """Raise where a folder could not be made, before the work.

    Parameters
    ----------
    path : Path
        May exist; its parents are made with it.

    Raises
    ------
    RecordingError
        When a part of the path is no folder, or cannot be written to.
    """
    folder = path
    while not os.path.lexists(folder) and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir():
        what = 'is no folder' if folder == path else f'{folder} is no folder'
        raise RecordingError(str(path), what, 'write elsewhere')
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RecordingError(
            str(path), f'the folder {folder} cannot be written to', 'write elsewhere'
        )
    _check_names(folder, path)
    if folder != path:
        _try_to_write(folder, path)


@contextmanager
def atomic_file(path: Path, error_type: type[NanorocksError] = RecordingError) -> Iterator[Path]:
    """Write a file under a temporary name and rename it once it is complete.

    Parameters
    ----------
    path : Path
        An existing file is replaced.
    error_type : type of NanorocksError
        Raised when the file cannot be written.

    Yields
    ------
    Path
        Temporary file to write, in the same folder and with the same suffix. It is deleted when
        the block raises.

    Raises
    ------
    NanorocksError
        Of `error_type`, when the file cannot be written.
    """
    try:
        part, lock = open_unfinished(path)
        try:
            yield part
            with part.open('rb+') as stream:
                os.fsync(stream.fileno())
            os.replace(part, path)
            _sync_folder(path.parent)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
            os.close(lock)
    except OSError as error:
        raise error_type(
            str(path),
            f'cannot be written ({error.strerror or error})',
            'make room, or write elsewhere',
        ) from error


def _sync_folder(folder: Path) -> None:
    """Force the new name to the disk; some file systems cannot, and need not."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def write_bytes(path: Path, content: bytes) -> None:
    """Write bytes to a file, complete or not at all.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    with atomic_file(path) as part:
        part.write_bytes(content)
