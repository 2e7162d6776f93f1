"""The sizes that an ``.npz`` file claims, held against the limit before it is unpacked.

Tested by ``test/outputs/test_npz_archive.py``.
"""

from __future__ import annotations

import math
import zipfile
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from nanorocks_ros.limits import ARRAY_BYTES

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.errors import NanorocksError

_HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
# No compression of these archives packs more.
_MAX_RATIO, _OVERHEAD = 1032, 1024


def check_archive(source: Path | BinaryIO, where: str, kind: type[NanorocksError]) -> None:
    """Raise for arrays that are larger than the limit, or than the file that claims them.

    Parameters
    ----------
    source : Path or binary file
        Read from its beginning; a file is left anywhere.
    where : str
        Its name, for errors.
    kind : type of NanorocksError
        Raised above the limit.

    Raises
    ------
    zipfile.BadZipFile, ValueError
        If it is no archive of arrays.
    NanorocksError
        Of `kind`, for arrays above the limit.
    """
    with zipfile.ZipFile(source) as archive:
        members = archive.infolist()
        for member in members:
            if member.file_size > _MAX_RATIO * member.compress_size + _OVERHEAD:
                raise ValueError(f'{member.filename} cannot hold what it claims')
        ARRAY_BYTES.check(sum(member.file_size for member in members), where, kind)
        for member in members:
            with archive.open(member) as stream:
                claimed = _claimed_bytes(stream)
            if claimed > member.file_size:
                raise ValueError(f'{member.filename} claims {claimed} bytes')


def _claimed_bytes(stream: object) -> int:
    """Size of an array by its header, [bytes]."""
    version = np.lib.format.read_magic(stream)  # type: ignore[arg-type]  # as a binary file
    reader = _HEADER_READERS.get(version)
    if reader is None:
        raise ValueError('no array of a known version')
    shape, _, dtype = reader(stream)  # type: ignore[arg-type]  # as a binary file
    if any(side < 0 for side in shape):
        raise ValueError('a negative shape')
    return math.prod(shape) * dtype.itemsize
