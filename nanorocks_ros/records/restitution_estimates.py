"""Coefficient of restitution of a cooling cycle."""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.records.quality_flags import (
    NOTHING_WRONG,
    UNKNOWN,
    CorRelation,
    CorStatus,
    Quality,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CorEstimate:
    """Coefficient of restitution of the collisions in one tray, with its interval.

    Parameters
    ----------
    stamp_ns : int
        Last speed used.
    tray, cycle : int
    status : CorStatus
    relation : CorRelation
        What turned the decay into a restitution.
    restitution, restitution_lower, restitution_upper : float, 0 to 1
        Of two beads: median of what is probable, and interval; statistical only for
        ``CorRelation.PAPER``.
    initial_speed, initial_speed_error : float, [m/s]
        Mean projected speed at `cooling_start`, from the fit.
    haff_time, haff_time_error : float, [s]
    reduced_chi_square : float
        Of the fit. For ``CorRelation.LIBRARY`` with the fluctuations of the gas and the errors of
        the speeds, near 1; for ``PAPER`` with the errors of the speeds alone.
    samples : int
        Speeds in the cooling window.
    mean_restitution, mean_restitution_error : float
        Of all cycles finished so far, and its standard error.
    wall_restitution, wall_restitution_lower, wall_restitution_upper : float, 0 to 1
        Of beads and side walls, as `restitution`.
    correlation : float, -1 to 1
        Of what is known of the two restitutions: near -1 in the valley in which a higher one of
        the beads makes up for a lower one of the walls.
    paper_restitution : float
        What the closed form of the paper makes of the decay, for comparison.
    quality : Quality
        What was wrong with the pictures behind the speeds.
    window_start, window_end : float, [s]
        First and last speed used, since the shaking event.
    cooling_start : float, [s]
        From when on the gas is taken to cool, since the shaking event: 0, or later when the tray
        swung on.
    rebounds, collisions : int
        Single contacts used besides the decay.
    tension : float
        Standard deviations by which decay, rebounds and collisions disagree.
    mean_wall_restitution, mean_wall_restitution_error : float
        As `mean_restitution`.
    first_species_initial_speed, first_species_initial_speed_error : float, [m/s]
        As `initial_speed`, of the first of `Tray.species` by itself; of a mixture whose species
        were told apart, once the cycle is over.
    first_species_haff_time, first_species_haff_time_error : float, [s]
    second_species_initial_speed, second_species_initial_speed_error : float, [m/s]
    second_species_haff_time, second_species_haff_time_error : float, [s]
    """

    stamp_ns: int
    tray: int
    cycle: int
    status: CorStatus
    relation: CorRelation
    restitution: float = UNKNOWN
    restitution_lower: float = UNKNOWN
    restitution_upper: float = UNKNOWN
    initial_speed: float = UNKNOWN
    initial_speed_error: float = UNKNOWN
    haff_time: float = UNKNOWN
    haff_time_error: float = UNKNOWN
    reduced_chi_square: float = UNKNOWN
    samples: int = 0
    mean_restitution: float = UNKNOWN
    mean_restitution_error: float = UNKNOWN
    wall_restitution: float = UNKNOWN
    wall_restitution_lower: float = UNKNOWN
    wall_restitution_upper: float = UNKNOWN
    correlation: float = UNKNOWN
    paper_restitution: float = UNKNOWN
    quality: Quality = NOTHING_WRONG
    window_start: float = UNKNOWN
    window_end: float = UNKNOWN
    cooling_start: float = UNKNOWN
    rebounds: int = 0
    collisions: int = 0
    tension: float = UNKNOWN
    mean_wall_restitution: float = UNKNOWN
    mean_wall_restitution_error: float = UNKNOWN
    first_species_initial_speed: float = UNKNOWN
    first_species_initial_speed_error: float = UNKNOWN
    first_species_haff_time: float = UNKNOWN
    first_species_haff_time_error: float = UNKNOWN
    second_species_initial_speed: float = UNKNOWN
    second_species_initial_speed_error: float = UNKNOWN
    second_species_haff_time: float = UNKNOWN
    second_species_haff_time_error: float = UNKNOWN
