"""Arrays in ``.npz`` files: written complete or not at all, refused when damaged."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.archive_limits import check_archive
from nanorocks_ros.errors import NanorocksError, RecordingError
from nanorocks_ros.limits import ARRAY_BYTES, require_regular_file
from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

Arrays = dict[str, 'NDArray[Any]']

# What zipfile and numpy raise for damaged files and files of other formats.
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    KeyError,
    OSError,
    RuntimeError,
    ValueError,
    NotImplementedError,
    OverflowError,
    MemoryError,
)


def write_archive(
    path: Path,
    arrays: Mapping[str, NDArray[Any]],
    error_type: type[NanorocksError] = RecordingError,
) -> None:
    """Write arrays as an ``.npz`` file that ``numpy.load`` reads, complete or not at all.

    Parameters
    ----------
    path : Path
        An existing file is replaced.
    arrays : mapping of str to ndarray
    error_type : type of NanorocksError
        Raised when the file cannot be written.

    Raises
    ------
    NanorocksError
        Of `error_type`, when the file cannot be written.
    """
    # A stream, since numpy appends .npz to names that end otherwise.
    with atomic_file(path, error_type) as part, part.open('wb') as stream:
        np.savez(stream, **dict(arrays))  # type: ignore[arg-type]  # a name is never allow_pickle


def read_archive(path: Path) -> Arrays:
    """Read an ``.npz`` file; checksums cover the arrays, but not their names.

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
    require_regular_file(path, RecordingError)
    try:
        ARRAY_BYTES.check(path.stat().st_size, str(path))
        content = path.read_bytes()
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'name another file'
        ) from error
    try:
        check_archive(io.BytesIO(content), str(path), RecordingError)
        # Checksums first: a damaged header may ask for any amount of memory.
        with zipfile.ZipFile(io.BytesIO(content)) as members:
            if members.testzip() is not None:
                raise zipfile.BadZipFile
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except _DAMAGE as error:
        raise RecordingError(
            str(path), 'is damaged, or no .npz file of arrays', 'make it again'
        ) from error
