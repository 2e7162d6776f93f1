"""Integer conversions for compiled code, so that it is compiled for one width only.

Tested by ``test/simulation/engine/test_observables.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined

if TYPE_CHECKING:
    from typing import Any


@inlined
def as_int64(value: Any) -> int:
    """A signed integer of 64 bits."""
    return np.int64(value)  # type: ignore[return-value]


@inlined
def as_index(value: Any) -> int:
    """An unsigned integer as an array index, which needs no check for negative values."""
    return np.uint32(value)  # type: ignore[return-value]
