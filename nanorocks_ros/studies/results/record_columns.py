"""The register of columns: how records become the columns of a table.

Every table of measured records follows from it, in CSV, Parquet and Python: the layout of the
array gives names, units and order, the record gives the kind. Codes and flags become words, times
seconds in float64.

Tested by ``test/studies/results/test_record_columns.py``.
"""

from __future__ import annotations

import dataclasses
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.tables.csv_tables import number
from nanorocks_ros.outputs.tables.table_columns import JOINED, Column
from nanorocks_ros.records import NS, Quality
from nanorocks_ros.wire.array_layouts import ENUMERATIONS, STAMPS, layout
from nanorocks_ros.wire.flat_records import flat_value, place_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.tables.table_columns import Kind
    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.wire.layout_fields import LayoutField

GOOD = 'good'
"""Stands for no flag at all: an empty cell would be "not known"."""

# Of the numbers that stand for words in the arrays, in words.
_DOCS = {
    'method': 'how the speed was measured',
    'status': 'state of the fit: cooling is provisional, undetermined says too little',
    'relation': 'what turned the decay into a restitution',
    'headline': 'source of restitution and wall_restitution: decay and contacts (joint), or one',
    'size_status': 'state of cluster_size',
    'sticking_status': 'state of sticking_speed',
    'quality': f'what was wrong with the pictures: flags, joined by "{JOINED}"; {GOOD}: nothing',
    'joins': 'true where bodies became fewer by it, false for two beads of one body',
}
_DTYPES: dict[Kind, Any] = {'float64': np.float64, 'int64': np.int64, 'bool': np.bool_}
# By the type that a record declares.
_KINDS: dict[object, Kind] = {'int': 'int64', 'bool': 'bool'}
# Arrays of a record whose elements are whole numbers.
_WHOLE = frozenset(('tracks', 'species'))


@cache
def columns_of(record_type: type[ArrayRecord]) -> tuple[Column, ...]:
    """The columns of the table of a kind of records, in order.

    Parameters
    ----------
    record_type : type
        One of those that are published as arrays, such as `SpeedEstimate`.
    """
    types = {field.name: field.type for field in dataclasses.fields(record_type)}
    return tuple(_column(record_type, field, types) for field in layout(record_type).fields)


def record_arrays(
    record_type: type[ArrayRecord], records: Sequence[ArrayRecord], epoch_ns: int
) -> dict[str, NDArray[Any]]:
    """Records as columns of a table.

    Parameters
    ----------
    record_type : type
    records : sequence of `record_type`, (n,)
    epoch_ns : int, [ns]
        What times count from.

    Returns
    -------
    dict of str to ndarray (n,)
        By the names of `columns_of`, in that order: float64 in SI units with NaN for "not known",
        int64, bool, or words.
    """
    arrays: dict[str, NDArray[Any]] = {}
    for column in columns_of(record_type):
        name = STAMPS.get(column.name, column.name)
        values = [flat_value(record, name) for record in records]
        if column.name in STAMPS:
            arrays[column.name] = _seconds(values, epoch_ns)
        elif column.kind == 'string':
            arrays[column.name] = np.array([word_of(value) for value in values], dtype=np.str_)
        else:
            arrays[column.name] = np.array(values, dtype=_DTYPES[column.kind])
    return arrays


def word_of(value: IntEnum | Quality) -> str:
    """The word of a code, or those of flags."""
    if isinstance(value, Quality):
        return JOINED.join(value.names()) or GOOD
    return value.name.lower()


def code_of(name: str, word: str) -> int:
    """The number that stands for words of a column in the arrays.

    Parameters
    ----------
    name : str
        Of the column.
    word : str

    Raises
    ------
    ValueError
        When the column has no such word.
    """
    enumeration: Callable[..., Any] | None = ENUMERATIONS.get(name)
    if enumeration is None:
        raise ValueError(f'{name} is no column of words')
    if enumeration is not Quality:
        return int(_member(ENUMERATIONS[name], word))
    flags = () if word == GOOD else word.split(JOINED)
    return sum(int(_member(Quality, flag)) for flag in flags)


def number_of(name: str, cell: str) -> float:
    """The number in a cell of a table of records; of words the number that stands for them.

    Tables of earlier versions hold these numbers themselves.

    Raises
    ------
    ValueError
        When it is neither.
    """
    try:
        return number(cell)
    except ValueError:
        if name not in ENUMERATIONS:
            raise
        return float(code_of(name, cell))


def _member(enumeration: Any, word: str) -> Any:
    try:
        return enumeration[word.upper()]
    except KeyError:
        raise ValueError(f'{word!r} is no word of {enumeration.__name__}') from None


def _column(record_type: type[ArrayRecord], field: LayoutField, types: dict[str, Any]) -> Column:
    doc = _DOCS.get(field.name, field.doc)
    enumeration = ENUMERATIONS.get(field.name)
    if enumeration is not None:
        several = enumeration is Quality
        words = tuple(member.name.lower() for member in enumeration)
        return Column(
            name=field.name,
            kind='string',
            doc=doc,
            words=(GOOD, *words) if several else words,
            several=several,
        )
    if field.name in STAMPS:
        return Column(name=field.name, unit=field.unit, doc=doc)
    place = place_of(record_type, field.name)
    kind: Kind = 'float64'
    if place.position and place.field in _WHOLE:
        kind = 'int64'
    elif not (place.position or place.attribute):
        kind = _KINDS.get(types[place.field], 'float64')
    return Column(name=field.name, kind=kind, unit=field.unit if kind != 'bool' else '', doc=doc)


def _seconds(stamps: Sequence[int | None], epoch_ns: int) -> NDArray[np.float64]:
    seconds = [np.nan if stamp is None else (stamp - epoch_ns) / NS for stamp in stamps]
    return np.array(seconds, dtype=np.float64)
