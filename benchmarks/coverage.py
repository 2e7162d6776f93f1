"""How often intervals hold the truth, and how wide they are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.records import Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Intervals compared with the truth.

    Parameters
    ----------
    known : int
        Intervals that have a value; the others do not count.
    holds : float
        Share of the intervals that hold the truth.
    half_width : float
        Mean.
    median_error : float
        Of the values.
    """

    known: int
    holds: float
    half_width: float
    median_error: float


def coverage(intervals: Iterable[Interval], truth: float) -> Coverage:
    """Compare intervals with the truth that they should hold.

    Parameters
    ----------
    intervals : iterable of Interval
    truth : float
    """
    known = [interval for interval in intervals if math.isfinite(interval.value)]
    return Coverage(
        known=len(known),
        holds=float(np.mean([interval.lower <= truth <= interval.upper for interval in known])),
        half_width=float(np.mean([0.5 * (interval.upper - interval.lower) for interval in known])),
        median_error=float(np.median([interval.value for interval in known])) - truth,
    )
