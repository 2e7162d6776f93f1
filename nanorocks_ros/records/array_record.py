"""The common fields of the records that are published as arrays.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar

if TYPE_CHECKING:
    from dataclasses import Field


class ArrayRecord(Protocol):
    """A dataclass that describes one tray at one instant; `wire.products` lists them all.

    Attributes
    ----------
    stamp_ns : int, [ns]
    tray, cycle : int
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def stamp_ns(self) -> int:
        """The instant, [ns]."""

    @property
    def tray(self) -> int:
        """Number of the tray."""

    @property
    def cycle(self) -> int:
        """Shaking events so far."""


RecordType = TypeVar('RecordType', bound=ArrayRecord)
