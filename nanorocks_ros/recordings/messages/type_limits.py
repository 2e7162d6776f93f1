"""Limits of message definitions that a recording brings.

Tested by ``test/recordings/messages/test_type_limits.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError

from nanorocks_ros.limits import TYPE_BYTES, TYPE_DEPTH, TYPE_FIELDS, Limit

if TYPE_CHECKING:
    from collections.abc import Mapping

_COLLECTIONS = (Nodetype.ARRAY, Nodetype.SEQUENCE)


def check_text(definition: str) -> None:
    """Raise for a definition that is too long to be parsed.

    Raises
    ------
    rosbags.typesys.TypesysError
        Names the setting that raises the limit.
    """
    if len(definition) > TYPE_BYTES.value:
        raise _exceeded(TYPE_BYTES)


def check_types(types: Mapping[str, Any]) -> None:
    """Raise for types that hold themselves, are nested too deeply or have too many fields.

    Parameters
    ----------
    types : mapping of str to (constants, fields)
        As parsed by rosbags.

    Raises
    ------
    rosbags.typesys.TypesysError
        Names the setting that raises the limit.
    """
    counts: dict[str, tuple[int, int]] = {}
    for name in types:
        _count(name, types, counts, ())


def _count(
    name: str,
    types: Mapping[str, Any],
    counts: dict[str, tuple[int, int]],
    above: tuple[str, ...],
) -> tuple[int, int]:
    """Number of fields of a type with those of its components, and levels below it."""
    if name in counts:
        return counts[name]
    if name in above:
        raise TypesysError(f'the type {name} holds itself')
    if len(above) >= TYPE_DEPTH.value:
        raise _exceeded(TYPE_DEPTH)
    fields, depth = 0, 0
    for _, node in types[name][1]:
        component, many = _component(node)
        below = (1, 0)
        if component in types:
            below = _count(component, types, counts, (*above, name))
            if many and not below[0]:
                raise TypesysError(f'an array of {component}, which has no fields')
        fields += max(1, below[0])
        depth = max(depth, below[1] + 1)
    if fields > TYPE_FIELDS.value:
        raise _exceeded(TYPE_FIELDS)
    if depth > TYPE_DEPTH.value:
        raise _exceeded(TYPE_DEPTH)
    counts[name] = fields, depth
    return counts[name]


def _component(node: Any) -> tuple[str, bool]:
    """Type of a field, or of the elements of one, and whether there are many."""
    kind, content = node
    if kind in _COLLECTIONS:
        return _component(content[0])[0], True
    return (str(content), False) if kind == Nodetype.NAME else ('', False)


def _exceeded(limit: Limit) -> TypesysError:
    return TypesysError(
        f'{limit.quantity}: above the limit of {limit.value} {limit.unit}; '
        f'{limit.variable} raises it'
    )
