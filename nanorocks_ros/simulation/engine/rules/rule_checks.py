"""Checks of the rules of collisions; every error names the rule and the value.

Tested by ``test/simulation/engine/rules/test_collision_rules.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

SMOOTH = -1.0
"""Tangential restitution of smooth beads."""


def three_floats(numbers: Sequence[float]) -> tuple[float, float, float]:
    """Three numbers as floats."""
    x, y, z = (float(number) for number in numbers)
    return x, y, z


def checked_box(box: Sequence[float]) -> tuple[float, float, float]:
    """Sides of the box, [m]; refused unless there are three positive ones."""
    if len(box) != 3:
        raise SimulationError('box', f'{len(box)} sides', 'give three, in metres')
    for name, side in zip('xyz', box, strict=True):
        if not (math.isfinite(side) and side > 0.0):
            raise SimulationError(
                'box', f'side_{name} is {side!r}', 'give positive sides in metres'
            )
    return three_floats(box)


def checked_axes(periodic: Sequence[bool]) -> tuple[bool, bool, bool]:
    """Whether each axis is periodic; refused unless there are three truth values."""
    if len(periodic) != 3:
        raise SimulationError('periodic', f'{len(periodic)} axes', 'give three truth values')
    x, y, z = (bool(axis) for axis in periodic)
    return x, y, z


def checked_restitutions(name: str, values: ArrayLike, allow_gain: bool) -> NDArray[np.float64]:
    """Restitutions as an array; refused outside 0 to 1, or below 0 with `allow_gain`."""
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SimulationError(name, f'{values!r}', 'give numbers from 0 to 1') from error
    for value in numbers.ravel().tolist():
        if not (0.0 <= value <= 1.0 or (allow_gain and math.isfinite(value) and value > 1.0)):
            raise SimulationError(
                name,
                f'{value!r} is outside [0, 1]',
                'give a value from 0 to 1, or above 1 with allow_gain=True',
            )
    return numbers


def checked_non_negative(name: str, value: float, unit: str) -> float:
    """A number; refused when it is negative or not finite."""
    if not (math.isfinite(value) and value >= 0.0):
        raise SimulationError(name, f'{value!r}', f'give 0 or a positive number, in {unit}')
    return float(value)


def checked_tangential(name: str, value: float | None) -> float:
    """Tangential restitution, -1 for None (smooth); refused outside -1 to 1."""
    if value is None:
        return SMOOTH
    if not -1.0 <= value <= 1.0:
        raise SimulationError(name, f'{value!r} is outside [-1, 1]', 'give a value from -1 to 1')
    return float(value)


def checked_friction(name: str, value: float) -> float:
    """Friction coefficient, perhaps infinite; refused when negative or NaN."""
    if not value >= 0.0:
        raise SimulationError(name, f'{value!r}', 'give 0 or more')
    return float(value)
