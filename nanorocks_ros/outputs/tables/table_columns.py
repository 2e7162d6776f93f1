"""A column of a table, in every form that tables are written in.

Tested by ``test/outputs/tables/test_csv_tables.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Iterable

Kind = Literal['float64', 'int64', 'int32', 'bool', 'string']
"""What a column holds, by the names of NumPy and pandas."""

JOINED = ';'
"""Between the words of a cell that holds several."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    name : str
        Letters, digits and underscores: the same in CSV, Parquet, JSON and Python.
    kind : Kind
    unit : str
        ``1`` for numbers without one; empty for words.
    doc : str
        What it means, in a phrase.
    words : tuple of str
        All words that may stand in a column of words; empty for any text.
    several : bool
        Whether a cell may hold several of `words`, joined by `JOINED`.
    """

    name: str
    kind: Kind = 'float64'
    unit: str = ''
    doc: str = ''
    words: tuple[str, ...] = ()
    several: bool = False


def float_columns(names: Iterable[str], units: Iterable[str]) -> tuple[Column, ...]:
    """Columns of numbers by their names and units, (n,) each."""
    return tuple(Column(name=name, unit=unit) for name, unit in zip(names, units, strict=True))
