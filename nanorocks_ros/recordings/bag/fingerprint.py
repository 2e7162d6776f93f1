"""What a recording is known by: a hash of its bytes, and the state of its files.

Bytes are hashed once, by whoever is about to read them anyway: a gigabyte takes a second, and is
in memory afterwards. As long as the files have not been touched since, which their sizes and times
tell, nothing is read again.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from nanorocks_ros.recordings.bag.bag_folder import STORAGE_SUFFIXES

if TYPE_CHECKING:
    from pathlib import Path

# Name, size, number of the inode, times of the last change of content and of anything else [ns].
FileState = tuple[str, int, int, int, int]
_BLOCK = 1 << 22


def file_states(path: Path) -> tuple[FileState, ...]:
    """State of the files of a recording, by name; they differ once anything was changed.

    Raises
    ------
    OSError
        When it cannot be looked at.
    """
    return tuple(_state(file) for file in _files(path))


def content_hash(path: Path) -> str:
    """A hash of everything in a recording, whatever it is called and wherever it lies.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    digest = hashlib.blake2b(digest_size=16)
    block = memoryview(bytearray(_BLOCK))
    for file in _files(path):
        digest.update(file.stat().st_size.to_bytes(8, 'little'))
        with file.open('rb', buffering=0) as stream:
            while count := stream.readinto(block):
                digest.update(block[:count])
    return digest.hexdigest()


def total_size(states: tuple[FileState, ...]) -> int:
    """Bytes of a recording."""
    return sum(state[1] for state in states)


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    return sorted(
        one
        for one in path.iterdir()
        if one.is_file() and (one.name == 'metadata.yaml' or STORAGE_SUFFIXES & {*one.suffixes})
    )


def _state(path: Path) -> FileState:
    found = path.stat()
    return path.name, found.st_size, found.st_ino, found.st_mtime_ns, found.st_ctime_ns
