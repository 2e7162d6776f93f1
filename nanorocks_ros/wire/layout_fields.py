"""The numbers of a message definition as elements of an array.

An array holds them as float32. A time is declared float64, of which float32 keeps seven digits:
8 ms after a day. Such a field is therefore followed, at the end of the array, by an element
``NAME_remainder`` to be added to it.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

_REMAINDER = '_remainder'


class LayoutField(NamedTuple):
    """One number of a message definition: its type (such as float32), name, unit and meaning."""

    number: str
    name: str
    unit: str
    doc: str

    @property
    def is_exact(self) -> bool:
        """Whether a second element of the array holds what float32 leaves out of the first."""
        return self.number == 'float64'

    @property
    def python_type(self) -> type[float | int | bool]:
        """The type of its values."""
        if self.number.startswith('float'):
            return float
        return bool if self.number == 'bool' else int

    def remainder(self) -> LayoutField:
        """That second element."""
        doc = f'to be added to {self.name}: what float32 leaves out of it'
        return LayoutField('float32', self.name + _REMAINDER, self.unit, doc)


def array_elements(fields: Iterable[LayoutField]) -> tuple[LayoutField, ...]:
    """The elements of the array of some fields: these, then the remainders of the exact ones."""
    fields = tuple(fields)
    return (*fields, *(field.remainder() for field in fields if field.is_exact))


def rounded_elements(
    fields: Iterable[LayoutField], values: Iterable[float]
) -> NDArray[np.float32]:
    """The array of the values of some fields: rounded, then the remainders of the exact ones.

    Parameters
    ----------
    fields : iterable of LayoutField, (n_fields,)
    values : iterable of float, (n_fields,)

    Returns
    -------
    ndarray of float32, (n_elements,)
        In the order of `array_elements`.
    """
    exact = np.array([field.is_exact for field in fields])
    numbers = np.fromiter(values, dtype=np.float64, count=len(exact))
    rounded = numbers.astype(np.float32)
    return np.append(rounded, (numbers[exact] - rounded[exact]).astype(np.float32))


def exact_values(
    fields: Sequence[LayoutField], elements: Sequence[float] | NDArray[np.floating[Any]]
) -> NDArray[np.float64]:
    """The values of some fields in an array of `rounded_elements`.

    Parameters
    ----------
    fields : sequence of LayoutField, (n_fields,)
    elements : sequence of float, (n_elements,) or (n_fields,)
        Without the remainders, as earlier versions wrote it, times are rounded.

    Returns
    -------
    ndarray of float64, (n_fields,)
    """
    numbers = np.asarray(elements, dtype=np.float64)
    values = numbers[: len(fields)].copy()
    if len(numbers) > len(fields):
        values[[field.is_exact for field in fields]] += numbers[len(fields) :]
    return values
