"""Mean and scatter of a sample with unknown values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


def mean_of(values: Sequence[float | None]) -> tuple[float, float, int]:
    """Mean, standard deviation (NaN for a single value) and number of the known values."""
    known = np.array([value for value in values if value is not None and math.isfinite(value)])
    if not known.size:
        return math.nan, math.nan, 0
    scatter = float(known.std(ddof=1)) if known.size > 1 else math.nan
    return float(known.mean()), scatter, int(known.size)
