"""Mean projected speed of a tray."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.records.quality_flags import NOTHING_WRONG, UNKNOWN, Quality, SpeedMethod

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedEstimate:
    """Mean projected speed of the beads of one tray over one window.

    Parameters
    ----------
    stamp_ns : int
        Middle of the window.
    tray, cycle : int
        ``cycle`` counts the shaking events seen so far; 0 before the first.
    mean_projected_speed, mean_projected_speed_error : float, [m/s]
    window : float, [s]
        Time between the two pictures compared.
    method : SpeedMethod
    cycle_start_ns : int or None
        The shaking event that opened the cycle; None before the first.
    quality : Quality
        What was wrong with the pictures since the last estimate, and with the estimate itself.
    first_species_speed, first_species_speed_error : float, [m/s]
    second_species_speed, second_species_speed_error : float, [m/s]
        Mean projected speed of the first two of `Tray.species`; unknown when they were not told
        apart.
    tray_speed : float, [m/s]
        Root of the mean square of the speed of the tray on its springs around that time, less what
        its errors may add; unknown where the tray was not followed.
    """

    stamp_ns: int
    tray: int
    cycle: int
    cycle_start_ns: int | None
    mean_projected_speed: float
    mean_projected_speed_error: float
    window: float
    method: SpeedMethod
    quality: Quality = NOTHING_WRONG
    first_species_speed: float = UNKNOWN
    first_species_speed_error: float = UNKNOWN
    second_species_speed: float = UNKNOWN
    second_species_speed_error: float = UNKNOWN
    tray_speed: float = UNKNOWN

    @staticmethod
    def by_species(speeds: Iterable[tuple[float, float]]) -> dict[str, float]:
        """The fields for the speeds of the species and their errors, [m/s]; two at most."""
        found = {}
        for name, (speed, error) in zip(('first', 'second'), speeds, strict=False):
            found[f'{name}_species_speed'] = speed
            found[f'{name}_species_speed_error'] = error
        return found
