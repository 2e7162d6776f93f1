"""Lists on disk, so that memory does not grow with the length of a recording."""

from __future__ import annotations

import pickle
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, TypeVar, overload

from nanorocks_ros.errors import UnwritableError

if TYPE_CHECKING:
    from pathlib import Path

Item = TypeVar('Item')

# Items written together; fewer are kept in memory.
_BLOCK = 256


class SpoolError(UnwritableError):
    """The temporary file cannot be written."""


class SpoolFile:
    """An unnamed temporary file that several spools share.

    Parameters
    ----------
    folder : Path
        On a disk with enough space.

    Raises
    ------
    SpoolError
        When the folder cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            self._file = TemporaryFile(dir=folder)  # noqa: SIM115  # closed with the last spool
        except OSError as error:
            raise SpoolError(
                str(folder), f'cannot be written ({error.strerror})', 'pass a writable --output'
            ) from error

    def add(self, content: bytes) -> tuple[int, int]:
        """Write bytes; return their offset and length.

        Raises
        ------
        SpoolError
            When the disk is full.
        """
        try:
            start = self._file.seek(0, 2)
            self._file.write(content)
            # Now, so that a full disk is noticed here and not when reading.
            self._file.flush()
        except OSError as error:
            raise SpoolError(
                str(self._folder), f'cannot be written ({error.strerror})', 'make room'
            ) from error
        return start, len(content)

    def get(self, extent: tuple[int, int]) -> bytes:
        """Read the bytes at an offset and of a length, as `add` returned them."""
        self._file.seek(extent[0])
        return self._file.read(extent[1])


class Spool(Sequence[Item]):
    """A list on disk that can be appended to and read.

    Parameters
    ----------
    file : SpoolFile
    """

    def __init__(self, file: SpoolFile) -> None:
        self._file = file
        self._places: list[tuple[int, int]] = []
        self._starts: list[int] = []
        self._tail: list[Item] = []
        self._length = 0

    def append(self, item: Item) -> None:
        """Add an item at the end."""
        self._tail.append(item)
        self._length += 1
        if len(self._tail) == _BLOCK:
            self._starts.append(self._length - _BLOCK)
            self._places.append(self._file.add(pickle.dumps(self._tail)))
            self._tail = []

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[Item]:
        for number in range(len(self._places)):
            yield from self._block(number)
        yield from self._tail

    def _block(self, number: int) -> list[Item]:
        items: list[Item] = pickle.loads(self._file.get(self._places[number]))
        return items

    @overload
    def __getitem__(self, index: int) -> Item: ...

    @overload
    def __getitem__(self, index: slice) -> list[Item]: ...

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(self._length))]
        if not -self._length <= index < self._length:
            raise IndexError(index)
        index %= self._length
        number = bisect_right(self._starts, index) - 1
        before = self._length - len(self._tail)
        if index >= before:
            return self._tail[index - before]
        return self._block(number)[index - self._starts[number]]
