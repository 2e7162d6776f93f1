"""Values for JSON objects, which have no NaN and no infinity."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import TEXT_BYTES, require_regular_file

if TYPE_CHECKING:
    from pathlib import Path


def parse_object(text: str) -> dict[str, Any]:
    """A JSON object.

    Raises
    ------
    ValueError
        If it is no JSON, nested too deeply, or anything else than an object.
    """
    try:
        content = json.loads(text)
    except RecursionError as error:
        raise ValueError('nested too deeply') from error
    if not isinstance(content, dict):
        raise ValueError('no JSON object')
    return content


def read_object(path: Path) -> dict[str, Any]:
    """The JSON object in a file.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it holds anything else.
    RecordingError
        If it is no regular file, or above the limit.
    """
    require_regular_file(path, RecordingError)
    TEXT_BYTES.check(path.stat().st_size, str(path))
    return parse_object(path.read_text('utf-8'))


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
