"""Lists that lie on the disk but for their ends, so that memory does not grow with a recording."""

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

# Items that are written together.
_BLOCK = 256


class SpoolError(UnwritableError):
    """There is no room for what was measured."""


class SpoolFile:
    """A file without a name, which goes with the process, that several spools share.

    Parameters
    ----------
    folder : Path
        On a disk with room.

    Raises
    ------
    SpoolError
        When nothing can be written there.
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
        """Keep some bytes; where they are.

        Raises
        ------
        SpoolError
            When there is no room for them.
        """
        try:
            place = self._file.seek(0, 2)
            self._file.write(content)
            # Here, not when they are read back.
            self._file.flush()
        except OSError as error:
            raise SpoolError(
                str(self._folder), f'cannot be written ({error.strerror})', 'make room'
            ) from error
        return place, len(content)

    def get(self, place: tuple[int, int]) -> bytes:
        """Bytes that were kept."""
        self._file.seek(place[0])
        return self._file.read(place[1])


class Spool(Sequence[Item]):
    """A list to append to and to read.

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
        """Add one at the end."""
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
        found: list[Item] = pickle.loads(self._file.get(self._places[number]))
        return found

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
