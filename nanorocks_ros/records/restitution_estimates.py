"""Coefficient of restitution of a cooling cycle.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.records.headlines import Headline
from nanorocks_ros.records.quality_flags import (
    NOTHING_WRONG,
    UNKNOWN,
    CorRelation,
    CorStatus,
    Quality,
)
from nanorocks_ros.records.values import (
    UNKNOWN_INTERVAL,
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Interval,
    Measured,
    MeasuredInterval,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CorEstimate:
    """Coefficient of restitution of the collisions in one tray, with its interval.

    Parameters
    ----------
    stamp_ns : int
        Last speed up to which decay or contacts count.
    tray, cycle : int
    status : CorStatus
    relation : CorRelation
        What turned the decay into a restitution.
    restitution : Interval, 0 to 1
        Of two beads, by the source that `headline` says: median of what is probable, and
        interval; statistical only for ``CorRelation.PAPER``.
    initial_speed : Measured, [m/s]
        Mean projected speed at `cooling_start`, from the fit.
    haff_time : Measured, [s]
    reduced_chi_square : float
        Of the fit. For ``CorRelation.LIBRARY`` with the fluctuations of the gas and the errors of
        the speeds, near 1; for ``PAPER`` with the errors of the speeds alone.
    samples : int
        Speeds of the decay.
    mean_restitution : Measured
        Of all cycles finished so far, and its standard error.
    wall_restitution : Interval, 0 to 1
        Of beads and side walls, as `restitution`.
    correlation : float, -1 to 1
        Of what is known of the two restitutions: near -1 in the valley in which a higher one of
        the beads makes up for a lower one of the walls.
    paper_restitution : float
        What the closed form of the paper makes of the decay, for comparison.
    quality : Quality
        What was wrong with the pictures behind the speeds.
    window_start, window_end : float, [s]
        First and last speed of the decay, since the shaking event; NaN where beads stuck too soon
        for a decay.
    cooling_start : float, [s]
        From when on the gas is taken to cool, since the shaking event: 0, or later when the tray
        swung on.
    rebounds, collisions : int
        Single contacts used besides the decay.
    tension : float
        Standard deviations by which decay, rebounds and collisions disagree.
    mean_wall_restitution : Measured
        As `mean_restitution`.
    species_initial_speeds : tuple of Measured, at most 2, [m/s]
        As `initial_speed`, of each of the first two of `Tray.species` by itself; of a mixture
        whose species were told apart, once the cycle is over.
    species_haff_times : tuple of Measured, at most 2, [s]
        As `haff_time`, of each species.
    headline : Headline
        Source of `restitution` and `wall_restitution`: decay and contacts together where they
        agree, contacts alone where they do not or walls rub.
    joint_restitution, joint_wall_restitution : Interval, 0 to 1
        By decay and contacts together, whether they agree or not.
    decay_restitution, decay_wall_restitution : Interval, 0 to 1
        By the decay alone.
    contact_restitution, contact_wall_restitution : Interval, 0 to 1
        By collisions and rebounds alone.
    wall_friction : Measured
        Coefficient of friction of the side walls, at least, from the tangential speeds of
        rebounds.
    drag : Measured, [1/s]
        Rate at which a gas slows beads of the first species, from free flights; decay and contacts
        are corrected for it.
    acceleration : MeasuredInterval, [m/s^2]
        Size of the acceleration that all beads have in common, in the image plane, with its
        limits.
    restitution_exponent, wall_restitution_exponent : Interval, -1 to 2
        Power of the impact speed with which 1 - restitution goes, of beads and of side walls, from
        their contacts; 0 where the restitution is constant.
    impact_speed, wall_impact_speed : float, [m/s]
        Geometric mean of the impact speeds of these contacts, along the normal.
    impact_restitution, wall_impact_restitution : Interval, 0 to 1
        Restitution at these speeds, by that power law. Where `SPEED_DEPENDENT` is set,
        `restitution` is that which loses as much energy in the contacts that were seen; the
        constant one is `contact_restitution`.
    onset : float, [s]
        From when on beads stick, since the shaking event: the decay counts until then; NaN where
        none do.
    body_rebounds : int
        Of `rebounds`, those of bodies of several beads.
    restitution_lower_68, restitution_upper_68 : float
        Ends of the interval of `restitution` with the probability `ONE_SIGMA`.
    wall_restitution_lower_68, wall_restitution_upper_68 : float
        The same of `wall_restitution`.
    restitution_exponent_lower_68, restitution_exponent_upper_68 : float
    wall_restitution_exponent_lower_68, wall_restitution_exponent_upper_68 : float
        The same of the exponents.
    """

    stamp_ns: int
    tray: int
    cycle: int
    status: CorStatus
    relation: CorRelation
    restitution: Interval = UNKNOWN_INTERVAL
    initial_speed: Measured = UNKNOWN_MEASURED
    haff_time: Measured = UNKNOWN_MEASURED
    reduced_chi_square: float = UNKNOWN
    samples: int = 0
    mean_restitution: Measured = UNKNOWN_MEASURED
    wall_restitution: Interval = UNKNOWN_INTERVAL
    correlation: float = UNKNOWN
    paper_restitution: float = UNKNOWN
    quality: Quality = NOTHING_WRONG
    window_start: float = UNKNOWN
    window_end: float = UNKNOWN
    cooling_start: float = UNKNOWN
    rebounds: int = 0
    collisions: int = 0
    tension: float = UNKNOWN
    mean_wall_restitution: Measured = UNKNOWN_MEASURED
    species_initial_speeds: tuple[Measured, ...] = ()
    species_haff_times: tuple[Measured, ...] = ()
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
    restitution_exponent: Interval = UNKNOWN_INTERVAL
    wall_restitution_exponent: Interval = UNKNOWN_INTERVAL
    impact_speed: float = UNKNOWN
    wall_impact_speed: float = UNKNOWN
    impact_restitution: Interval = UNKNOWN_INTERVAL
    wall_impact_restitution: Interval = UNKNOWN_INTERVAL
    onset: float = UNKNOWN
    body_rebounds: int = 0
    restitution_lower_68: float = UNKNOWN
    restitution_upper_68: float = UNKNOWN
    wall_restitution_lower_68: float = UNKNOWN
    wall_restitution_upper_68: float = UNKNOWN
    restitution_exponent_lower_68: float = UNKNOWN
    restitution_exponent_upper_68: float = UNKNOWN
    wall_restitution_exponent_lower_68: float = UNKNOWN
    wall_restitution_exponent_upper_68: float = UNKNOWN
