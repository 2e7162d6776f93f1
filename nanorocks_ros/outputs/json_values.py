"""Values for JSON objects, which have no NaN and no infinity."""

from __future__ import annotations

import math
from typing import Any


def finite_or_none(value: float) -> float | None:
    """The value itself; None for NaN and infinity."""
    return value if math.isfinite(value) else None


def json_values(value: Any) -> Any:
    """Nested values with None for every float that is NaN or infinite.

    Parameters
    ----------
    value : object
        Arrays, tuples and lists become lists; dictionaries are searched; NumPy scalars become
        those of Python; other values stay.
    """
    if hasattr(value, 'tolist'):
        return json_values(value.tolist())
    if isinstance(value, dict):
        return {name: json_values(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    return finite_or_none(value) if isinstance(value, float) else value
