"""Arrays in a file: complete or not at all, and refused when damaged."""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

Arrays = dict[str, 'NDArray[Any]']

# What zipfile and numpy raise for bytes that are not theirs.
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    KeyError,
    OSError,
    RuntimeError,
    ValueError,
)


def write_archive(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as an ``.npz`` file that ``numpy.load`` reads.

    Parameters
    ----------
    path : Path
        An earlier file there is replaced, once the new one is complete.
    arrays : mapping of str to ndarray

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    buffer = io.BytesIO()
    np.savez(buffer, **dict(arrays))  # type: ignore[arg-type]  # a name is never allow_pickle
    write_whole(path, buffer.getvalue())


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is there complete or, whatever happens, not at all.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    part = path.with_name(f'.{path.name}.part')
    try:
        try:
            with part.open('wb') as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(part, path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be written ({error.strerror})', 'make room, or write elsewhere'
        ) from error


def read_archive(path: Path) -> Arrays:
    """Arrays of an ``.npz`` file; every byte of them, though not of their names, is checked.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict of str to ndarray

    Raises
    ------
    RecordingError
        When the file cannot be read, is cut short or damaged, or holds anything but arrays.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'name another file'
        ) from error
    try:
        # Checksums first: a damaged header may ask for any amount of memory.
        with zipfile.ZipFile(io.BytesIO(content)) as members:
            if members.testzip() is not None:
                raise zipfile.BadZipFile
        with np.load(io.BytesIO(content), allow_pickle=False) as found:
            return {name: found[name] for name in found.files}
    except _DAMAGE as error:
        raise RecordingError(
            str(path), 'is damaged, or no .npz file of arrays', 'make it again'
        ) from error
