"""Whole numbers in compiled code: one width, so that nothing is compiled for two."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined

if TYPE_CHECKING:
    from typing import Any


@inlined
def whole(value: Any) -> int:
    """A number with 64 bits."""
    return np.int64(value)  # type: ignore[return-value]


@inlined
def unsigned(value: Any) -> int:
    """A number that is never negative, as a place in an array: nothing is counted from its end."""
    return np.uint32(value)  # type: ignore[return-value]
