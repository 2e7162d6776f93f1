"""The restitution of one cycle, as a method determines it.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.records import (
    UNKNOWN,
    UNKNOWN_INTERVAL,
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Headline,
    Interval,
    Measured,
    MeasuredInterval,
)

UNDETERMINED = Interval(lower=0.0, upper=1.0)
"""The restitution of a cycle that does not determine it: any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleRestitution:
    """What a method determines from one cycle; quantities as in `CorEstimate`.

    Parameters
    ----------
    determined : bool
        Whether the cycle determines the restitution of two beads.
    restitution, wall_restitution : Interval
    correlation : float
    initial_speed : Measured, [m/s]
    haff_time : Measured, [s]
    reduced_chi_square, paper_restitution, tension : float
    rebounds, collisions, body_rebounds : int
    mean_restitution, mean_wall_restitution : Measured
    headline : Headline
    joint_restitution, joint_wall_restitution : Interval
    decay_restitution, decay_wall_restitution : Interval
    contact_restitution, contact_wall_restitution : Interval
    wall_friction : Measured
    drag : Measured
    acceleration : MeasuredInterval
    accelerated : bool
        Whether that is far from 0 and changes the speeds, so that the decay does not count.
    restitution_exponent, wall_restitution_exponent : Interval
    impact_speed, wall_impact_speed : float, [m/s]
    impact_restitution, wall_impact_restitution : Interval
    restitution_lower_68, restitution_upper_68 : float
    wall_restitution_lower_68, wall_restitution_upper_68 : float
    restitution_exponent_lower_68, restitution_exponent_upper_68 : float
    wall_restitution_exponent_lower_68, wall_restitution_exponent_upper_68 : float
    speed_dependent : bool
        Whether an exponent is not 0, so that neither the decay nor a constant restitution holds.
    friction_unknown : bool
        Whether beads count as smooth that may rub.
    """

    determined: bool = False
    restitution: Interval = UNDETERMINED
    wall_restitution: Interval = UNKNOWN_INTERVAL
    correlation: float = UNKNOWN
    initial_speed: Measured = UNKNOWN_MEASURED
    haff_time: Measured = UNKNOWN_MEASURED
    reduced_chi_square: float = UNKNOWN
    paper_restitution: float = UNKNOWN
    rebounds: int = 0
    collisions: int = 0
    body_rebounds: int = 0
    tension: float = UNKNOWN
    mean_restitution: Measured = UNKNOWN_MEASURED
    mean_wall_restitution: Measured = UNKNOWN_MEASURED
    headline: Headline = Headline.UNKNOWN
    joint_restitution: Interval = UNKNOWN_INTERVAL
    joint_wall_restitution: Interval = UNKNOWN_INTERVAL
    decay_restitution: Interval = UNKNOWN_INTERVAL
    decay_wall_restitution: Interval = UNKNOWN_INTERVAL
    contact_restitution: Interval = UNKNOWN_INTERVAL
    contact_wall_restitution: Interval = UNKNOWN_INTERVAL
    wall_friction: Measured = UNKNOWN_MEASURED
    drag: Measured = UNKNOWN_MEASURED
    acceleration: MeasuredInterval = UNKNOWN_MEASURED_INTERVAL
    accelerated: bool = False
    restitution_exponent: Interval = UNKNOWN_INTERVAL
    wall_restitution_exponent: Interval = UNKNOWN_INTERVAL
    impact_speed: float = UNKNOWN
    wall_impact_speed: float = UNKNOWN
    impact_restitution: Interval = UNKNOWN_INTERVAL
    wall_impact_restitution: Interval = UNKNOWN_INTERVAL
    restitution_lower_68: float = UNKNOWN
    restitution_upper_68: float = UNKNOWN
    wall_restitution_lower_68: float = UNKNOWN
    wall_restitution_upper_68: float = UNKNOWN
    restitution_exponent_lower_68: float = UNKNOWN
    restitution_exponent_upper_68: float = UNKNOWN
    wall_restitution_exponent_lower_68: float = UNKNOWN
    wall_restitution_exponent_upper_68: float = UNKNOWN
    speed_dependent: bool = False
    friction_unknown: bool = False
