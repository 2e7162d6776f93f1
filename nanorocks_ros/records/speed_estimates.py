"""Mean projected speed of a tray.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.records.quality_flags import NOTHING_WRONG, UNKNOWN, Quality, SpeedMethod
from nanorocks_ros.records.values import Measured


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedEstimate:
    """Mean projected speed of the beads of one tray over one window.

    Parameters
    ----------
    stamp_ns : int
        Middle of the window.
    tray, cycle : int
        ``cycle`` counts the shaking events seen so far; 0 before the first.
    mean_projected_speed : Measured, [m/s]
    window : float, [s]
        Time between the two pictures compared.
    method : SpeedMethod
    cycle_start_ns : int or None
        The shaking event that opened the cycle; None before the first.
    quality : Quality
        What was wrong with the pictures since the last estimate, and with the estimate itself.
    species_speeds : tuple of Measured, at most 2, [m/s]
        Mean projected speed of the first two of `Tray.species`; empty when the species were not
        told apart.
    tray_speed : float, [m/s]
        Root of the mean square of the speed of the tray on its springs around that time, less what
        its errors may add; unknown where the tray was not followed.
    """

    stamp_ns: int
    tray: int
    cycle: int
    cycle_start_ns: int | None
    mean_projected_speed: Measured
    window: float
    method: SpeedMethod
    quality: Quality = NOTHING_WRONG
    species_speeds: tuple[Measured, ...] = ()
    tray_speed: float = UNKNOWN
