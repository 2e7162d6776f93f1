"""Measured values: a number with its standard error, its interval, or both.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from nanorocks_ros.records.quality_flags import UNKNOWN

ONE_SIGMA = 0.6827
"""Probability of an interval from one standard deviation below to one above, if normal."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A value and its standard error, both NaN where they are not known."""

    value: float = UNKNOWN
    error: float = UNKNOWN

    @property
    def known(self) -> bool:
        """Whether both are finite numbers."""
        return math.isfinite(self.value) and math.isfinite(self.error)


@dataclass(frozen=True, slots=True)
class Interval:
    """A value between a lower and an upper limit, NaN where they are not known."""

    value: float = UNKNOWN
    lower: float = UNKNOWN
    upper: float = UNKNOWN


@dataclass(frozen=True, slots=True)
class MeasuredInterval:
    """A value, its standard error and its limits, NaN where they are not known."""

    value: float = UNKNOWN
    error: float = UNKNOWN
    lower: float = UNKNOWN
    upper: float = UNKNOWN

    @property
    def measured(self) -> Measured:
        """Value and error, without the limits."""
        return Measured(self.value, self.error)


UNKNOWN_MEASURED = Measured()
UNKNOWN_INTERVAL = Interval()
UNKNOWN_MEASURED_INTERVAL = MeasuredInterval()
