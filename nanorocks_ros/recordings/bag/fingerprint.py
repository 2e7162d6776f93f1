"""Identity of a recording: a hash of its bytes, and the state of its files.

Hashing takes about one second per gigabyte and leaves the bytes in the page cache, so it is done
just before a recording is analysed. As long as size, inode and times of the files are unchanged,
the recording need not be hashed again.

Tested by ``test/recordings/bag/test_find_bags.py``.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from nanorocks_ros.recordings.bag.bag_folder import STORAGE_SUFFIXES

if TYPE_CHECKING:
    from pathlib import Path

# Name, size, inode number, time of the last content change (mtime), time of the last change of
# content or metadata (ctime), [ns].
FileState = tuple[str, int, int, int, int]
_BLOCK_BYTES = 1 << 22


def file_states(path: Path) -> tuple[FileState, ...]:
    """State of each file of a recording, in order of name; it changes with any change of a file.

    Raises
    ------
    OSError
        If a file cannot be accessed.
    """
    return tuple(_state(file) for file in _files(path))


def content_hash(path: Path) -> str:
    """Hash of the content of a recording; it does not depend on its name and folder.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    digest = hashlib.blake2b(digest_size=16)
    block = memoryview(bytearray(_BLOCK_BYTES))
    for file in _files(path):
        digest.update(file.stat().st_size.to_bytes(8, 'little'))
        with file.open('rb', buffering=0) as stream:
            while count := stream.readinto(block):
                digest.update(block[:count])
    return digest.hexdigest()


def total_size(states: tuple[FileState, ...]) -> int:
    """Size of a recording, [bytes]."""
    return sum(state[1] for state in states)


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    return sorted(
        file
        for file in path.iterdir()
        if file.is_file() and (file.name == 'metadata.yaml' or STORAGE_SUFFIXES & {*file.suffixes})
    )


def _state(path: Path) -> FileState:
    status = path.stat()
    return path.name, status.st_size, status.st_ino, status.st_mtime_ns, status.st_ctime_ns
