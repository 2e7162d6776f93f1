"""Conversion between the values of records and named array elements.

Records hold values (`Interval`, `Measured`), tuples per species and arrays per bead; an array of
the wire is flat. ``restitution`` is the value of the interval of that name and
``restitution_lower`` its limit; ``first_species_speed_error`` belongs to ``species_speeds[0]``;
``before_1_x`` is ``before[0, 0]``.
"""

from __future__ import annotations

import math
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from nanorocks_ros.records import Interval, Measured, MeasuredInterval

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.records import ArrayRecord

Value = Interval | Measured | MeasuredInterval
ValueType = TypeVar('ValueType', bound=Value)

# By the type that a record declares.
_VALUE_TYPES: dict[object, type[Value]] = {
    kind.__name__: kind for kind in (Interval, Measured, MeasuredInterval)
}
_VALUES_OF_SPECIES = 'tuple[Measured, ...]'
_SPECIES = ('first', 'second')
_AXES = ('x', 'y')
_SIZES = ('1', '2', '3', '4_to_6', '7_or_more')
# Of two beads: the element and the array in the record.
_ARRAYS_OF_BEADS = {
    'track_{}': 'tracks',
    'species_{}': 'species',
    'radius_{}': 'radii',
    'radius_{}_error': 'radius_errors',
    'mass_{}': 'masses',
    'temperature_{}': 'temperatures',
    'before_{}_error': 'before_errors',
    'after_{}_error': 'after_errors',
    'before_{}_drag_time': 'before_drag_times',
    'after_{}_drag_time': 'after_drag_times',
}
_INTEGERS = frozenset(('tracks', 'species'))


class Place(NamedTuple):
    """Where a record holds an element of its array.

    Attributes
    ----------
    field : str
    position : tuple of int
        Into an array or a tuple; empty for a single value.
    attribute : str
        Of an `Interval`, `Measured` or `MeasuredInterval`; empty for a plain number.
    """

    field: str
    position: tuple[int, ...] = ()
    attribute: str = ''


_ARRAY_PLACES = {
    **{
        name.format(bead + 1): Place(array, (bead,))
        for name, array in _ARRAYS_OF_BEADS.items()
        for bead in (0, 1)
    },
    **{
        f'{array}_{bead + 1}_{letter}': Place(array, (bead, axis))
        for array in ('before', 'after')
        for bead in (0, 1)
        for axis, letter in enumerate(_AXES)
    },
    **{f'bodies_of_{size}': Place('sizes', (k,)) for k, size in enumerate(_SIZES)},
    **{
        f'{array}_{letter}': Place(array, (axis,))
        for array in ('separation', 'place', 'mean_velocity', 'mean_acceleration')
        for axis, letter in enumerate(_AXES)
    },
}


@cache
def flat_names(record_type: type[ArrayRecord]) -> dict[str, Place]:
    """The places of all elements by name, except elements of arrays."""
    places: dict[str, Place] = {}
    for field in fields(record_type):
        if field.type in _VALUE_TYPES:
            for name, attribute in _attributes(field.name, _VALUE_TYPES[field.type]):
                places[name] = Place(field.name, (), attribute)
        elif field.type == _VALUES_OF_SPECIES:
            base = field.name.removesuffix('s')
            for number, ordinal in enumerate(_SPECIES):
                for name, attribute in _attributes(f'{ordinal}_{base}', Measured):
                    places[name] = Place(field.name, (number,), attribute)
        else:
            places[field.name] = Place(field.name)
    return places


def _attributes(name: str, value_type: type[Any]) -> list[tuple[str, str]]:
    """The flat names of a value, and its attributes."""
    return [
        (name if field.name == 'value' else f'{name}_{field.name}', field.name)
        for field in fields(value_type)
    ]


def place_of(record_type: type[ArrayRecord], name: str) -> Place:
    """Where the records of a type hold an element of the array."""
    return _ARRAY_PLACES.get(name) or flat_names(record_type)[name]


def flat_value(record: ArrayRecord, name: str) -> Any:
    """The value of an element, as the record holds it; NaN for a species without a value.

    Parameters
    ----------
    record : ArrayRecord
    name : str
        Of the element; a stamp under its name in the record.
    """
    field, index, attribute = place_of(type(record), name)
    value = getattr(record, field)
    if isinstance(value, tuple):
        value = value[index[0]] if index[0] < len(value) else Measured()
    elif index:
        value = value[index]
    return getattr(value, attribute) if attribute else value


def nested_fields(
    record_type: type[ArrayRecord], numbers: Mapping[str, float]
) -> dict[str, Value | tuple[Measured, ...] | NDArray[Any]]:
    """The fields of a record that hold more than one element.

    Parameters
    ----------
    record_type : type
    numbers : mapping of str to float
        The elements by name.

    Returns
    -------
    dict of str to Interval, Measured, MeasuredInterval, tuple of Measured or ndarray
        Without trailing species of which nothing is known.
    """
    nested: dict[str, Value | tuple[Measured, ...] | NDArray[Any]] = {**_arrays(numbers)}
    for field in fields(record_type):
        if field.type in _VALUE_TYPES:
            nested[field.name] = _nested(field.name, _VALUE_TYPES[field.type], numbers)
        elif field.type == _VALUES_OF_SPECIES:
            base = field.name.removesuffix('s')
            values = [_nested(f'{ordinal}_{base}', Measured, numbers) for ordinal in _SPECIES]
            while values and math.isnan(values[-1].value) and math.isnan(values[-1].error):
                values.pop()
            nested[field.name] = tuple(values)
    return nested


def _nested(name: str, value_type: type[ValueType], numbers: Mapping[str, float]) -> ValueType:
    names = _attributes(name, value_type)
    return value_type(**{attribute: numbers[element] for element, attribute in names})


def _arrays(numbers: Mapping[str, float]) -> dict[str, NDArray[Any]]:
    """The arrays of a record, from their elements."""
    elements: dict[str, dict[tuple[int, ...], float]] = {}
    for name, number in numbers.items():
        if place := _ARRAY_PLACES.get(name):
            elements.setdefault(place.field, {})[place.position] = number
    arrays: dict[str, NDArray[Any]] = {}
    for field, by_index in elements.items():
        shape = tuple(1 + max(place) for place in zip(*by_index, strict=True))
        array = np.full(shape, np.nan)
        for index, number in by_index.items():
            array[index] = number
        arrays[field] = array.astype(np.int32) if field in _INTEGERS else array
    return arrays
