"""Conversion of records to arrays and back, by the layouts in ``msg_defs``."""

from __future__ import annotations

import dataclasses
import math
import re
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.records import (
    NS,
    CorRelation,
    CorStatus,
    Headline,
    Quality,
    RecordType,
    SizeStatus,
    SpeedMethod,
    StickingStatus,
)
from nanorocks_ros.wire.flat_records import flat_value, nested_fields
from nanorocks_ros.wire.layout_fields import (
    LayoutField,
    array_elements,
    exact_values,
    rounded_elements,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import ArrayRecord


ENUMERATIONS = {
    'method': SpeedMethod,
    'quality': Quality,
    'status': CorStatus,
    'relation': CorRelation,
    'headline': Headline,
    'size_status': SizeStatus,
    'sticking_status': StickingStatus,
}
"""What the numbers of a field stand for, by the name of the field."""
# By the type that a record declares.
_WHOLE = {'int': int, 'bool': bool}
STAMPS = {
    'time': 'stamp_ns',
    'cycle_start': 'cycle_start_ns',
    'known': 'known_ns',
    'first_merge': 'first_merge_ns',
}
"""Fields that a record keeps as an integer stamp, and the names of the stamps."""
_NUMBER = r'(u?int\d+|float\d+|bool)'
_FIELD = re.compile(rf'^{_NUMBER}\s+([a-z]\w*)\s*#\s*\[([^\]]+)\]\s*(.*)$')
_CONSTANT = re.compile(rf'^{_NUMBER}\s+([A-Z]\w*)\s*=\s*(\d+)$')


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The elements of one kind of array.

    Parameters
    ----------
    name : str
        Of the record and of the message definition.
    doc : str
        First sentence of the definition.
    fields : tuple of LayoutField
        The numbers of the definition.
    constants : dict of str to int
    """

    name: str
    doc: str
    fields: tuple[LayoutField, ...]
    constants: dict[str, int]

    @property
    def elements(self) -> tuple[LayoutField, ...]:
        """The elements of the array: the fields, then the remainders of times."""
        return array_elements(self.fields)

    @property
    def labels(self) -> list[str]:
        """The names of the elements."""
        return [element.name for element in self.elements]

    @property
    def label(self) -> str:
        """The same, separated by commas: ``layout.dim[0].label`` of the array."""
        return ','.join(self.labels)


def layout(record_type: type[ArrayRecord]) -> Layout:
    """The layout of a record, from its message definition."""
    return _layout(record_type.__name__)


@cache
def _layout(name: str) -> Layout:
    text = resources.files(__package__).joinpath('msg', f'{name}.msg').read_text('utf-8')
    lines = [line.strip() for line in text.splitlines()]
    fields = [LayoutField(*match.groups()) for line in lines if (match := _FIELD.match(line))]
    constants = [match.group(2, 3) for line in lines if (match := _CONSTANT.match(line))]
    return Layout(
        name=name,
        doc=lines[0].removeprefix('# '),
        fields=tuple(fields),
        constants={key: int(value) for key, value in constants},
    )


def to_array(record: ArrayRecord, epoch_ns: int) -> NDArray[np.float32]:
    """The elements of a record in the order of its layout.

    Parameters
    ----------
    record : any of ArrayRecord
    epoch_ns : int, [ns]
        What `time` counts from.

    Returns
    -------
    ndarray of float32, (n_elements,)
        NaN where a value is not known.
    """
    fields = layout(type(record)).fields
    return rounded_elements(fields, (field_value(record, field, epoch_ns) for field in fields))


def field_value(record: ArrayRecord, field: LayoutField, epoch_ns: int) -> float:
    """The number that a record holds in a field of its layout; NaN where it is not known.

    Parameters
    ----------
    record : any of ArrayRecord
    field : LayoutField
    epoch_ns : int, [ns]
        What `time` counts from.
    """
    name = field.name
    value = flat_value(record, STAMPS.get(name, name))
    if value is None:
        return math.nan
    return (value - epoch_ns) / NS if name in STAMPS else float(value)


def enumerated(record: ArrayRecord) -> dict[str, str | list[str]]:
    """The words of the enumerations in a record, by the name of their field in typed messages.

    ``status_name`` is the name of ``status`` in lower case, ``quality_names`` a list of flags.
    """
    words: dict[str, str | list[str]] = {}
    for field in layout(type(record)).fields:
        if field.name in ENUMERATIONS:
            value = flat_value(record, field.name)
            if isinstance(value, Quality):
                words[f'{field.name}_names'] = value.names()
            else:
                words[f'{field.name}_name'] = value.name.lower()
    return words


def from_array(
    record_type: type[RecordType],
    values: Sequence[float] | NDArray[np.float32],
    *,
    tray: int,
    epoch_ns: int,
    where: str,
) -> RecordType:
    """The record of an array.

    Parameters
    ----------
    record_type : type
    values : sequence of float
    tray : int
        From the topic name.
    epoch_ns : int, [ns]
    where : str
        The topic, for the error.

    Raises
    ------
    FrameError
        When the number of elements is not that of the layout or a stamp is missing.
    """
    fields, elements = layout(record_type).fields, layout(record_type).elements
    # Recordings of earlier versions have no remainders of times.
    if len(values) not in (len(fields), len(elements)):
        raise FrameError(
            where,
            f'{len(values)} elements where {record_type.__name__} has {len(elements)}',
            'use the same release of nanorocks_ros on both sides',
        )
    if not math.isfinite(values[0]):
        raise FrameError(where, f'time is {values[0]}', 'publish the time in element 0')
    kinds = {field.name: field.type for field in dataclasses.fields(record_type)}
    exact = exact_values(fields, values).tolist()
    numbers = {field.name: value for field, value in zip(fields, exact, strict=True)}
    items: dict[str, Any] = {'tray': tray, **nested_fields(record_type, numbers)}
    for name, number in numbers.items():
        in_record = STAMPS.get(name, name)
        if in_record in items or in_record not in kinds:
            continue
        try:
            items[in_record] = _value(name, kinds[in_record], number, epoch_ns)
        except (ValueError, OverflowError) as error:
            raise FrameError(
                where,
                f'{name} is {number}',
                'use the same release of nanorocks_ros on both sides',
            ) from error
    make_record: Callable[..., RecordType] = record_type
    return make_record(**items)


def _value(name: str, kind: object, value: float, epoch_ns: int) -> object:
    if name in STAMPS:
        return epoch_ns + round(value * NS) if math.isfinite(value) else None
    if kind in _WHOLE:
        return _WHOLE[kind](value)
    return ENUMERATIONS[name](int(value)) if name in ENUMERATIONS else value
