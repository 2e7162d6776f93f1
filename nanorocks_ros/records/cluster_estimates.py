"""Clusters of a tray: autocorrelation, bodies, merges.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records.quality_flags import UNKNOWN, SizeStatus, StickingStatus, freeze_arrays
from nanorocks_ros.records.values import (
    UNKNOWN_INTERVAL,
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Interval,
    Measured,
    MeasuredInterval,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Standard errors of the tracks within which an interval of the autocorrelation must begin.
_DISAGREEMENT = 2.0


def sizes_disagree(autocorrelation: MeasuredInterval, tracks: Measured) -> bool:
    """Whether autocorrelation and tracks say different weight-averaged sizes.

    Parameters
    ----------
    autocorrelation : MeasuredInterval, [beads]
    tracks : Measured, [beads]
        Where they are not known, nothing disagrees.
    """
    reach = _DISAGREEMENT * tracks.error
    return tracks.known and (
        autocorrelation.lower > tracks.value + reach
        or autocorrelation.upper < tracks.value - reach
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterEstimate:
    """Width of the autocorrelation of one tray image, and clusters by that and by tracks.

    Parameters
    ----------
    stamp_ns : int
    tray, cycle : int
    level_area : float, [m^2]
        Area around zero lag where the normalised autocorrelation exceeds the chosen level; 0 for a
        uniform image.
    correlation_length : float, [m]
        Radius of the disc of that area.
    axes_ratio : float, >= 1
        Longer over shorter axis of that area.
    direction : float, [rad], -pi/2 to pi/2
        From the columns to its longer axis, positive towards the rows (down in the picture).
    breadth : float, >= 1
        `level_area` over the area at 0.7; less dependent on the camera than either.
    cluster_size : MeasuredInterval, [beads]
        Number of beads per body, averaged over the beads (weight-averaged): 1 when all are single.
        Between the limits the width is one standard deviation off or less; a size beyond the
        calibration, or contradicted by the tracks, has limits, too.
    size_status : SizeStatus
    bodies : Measured
        Free bodies by tracks: single beads and clusters; unknown where beads are not tracked.
    mean_size : float, [beads]
        By tracks: beads of a body, mean over the bodies.
    weighted_size : Measured, [beads]
        The same, mean over the beads.
    clustered_share : float, 0 to 1
        Of the beads, in bodies of two and more, by tracks.
    combined_size : Measured, [beads]
        Weight-averaged size by the autocorrelation and by tracks together.
    onset : float, [s]
        First merge of the cycle, since the shaking event; unknown before.
    sticking_status : StickingStatus
    sticking_speed : Interval, [m/s]
        Beads that meet more slowly stick: by the merges of this cycle so far, with an interval.
    mean_sticking_speed : Interval, [m/s]
        By all cycles before this one.
    sticking_speed_lower_68, sticking_speed_upper_68 : float, [m/s]
        Ends of the interval of `sticking_speed` with the probability `ONE_SIGMA`.
    mean_sticking_speed_lower_68, mean_sticking_speed_upper_68 : float, [m/s]
        The same of `mean_sticking_speed`.
    """

    stamp_ns: int
    tray: int
    cycle: int
    level_area: float
    correlation_length: float
    axes_ratio: float = UNKNOWN
    direction: float = UNKNOWN
    breadth: float = UNKNOWN
    cluster_size: MeasuredInterval = UNKNOWN_MEASURED_INTERVAL
    size_status: SizeStatus = SizeStatus.UNCALIBRATED
    bodies: Measured = UNKNOWN_MEASURED
    mean_size: float = UNKNOWN
    weighted_size: Measured = UNKNOWN_MEASURED
    clustered_share: float = UNKNOWN
    combined_size: Measured = UNKNOWN_MEASURED
    onset: float = UNKNOWN
    sticking_status: StickingStatus = StickingStatus.UNKNOWN
    sticking_speed: Interval = UNKNOWN_INTERVAL
    mean_sticking_speed: Interval = UNKNOWN_INTERVAL
    sticking_speed_lower_68: float = UNKNOWN
    sticking_speed_upper_68: float = UNKNOWN
    mean_sticking_speed_lower_68: float = UNKNOWN
    mean_sticking_speed_upper_68: float = UNKNOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class Autocorrelation:
    """Normalised autocorrelation of a tray image, zero lag in the centre.

    Parameters
    ----------
    values : ndarray of float32, (rows, columns)
        1 at zero lag.
    """

    stamp_ns: int
    tray: int
    values: NDArray[np.float32]

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Merge:
    """Two beads that stick to each other from an instant on.

    Parameters
    ----------
    stamp_ns : int
        Since when they stay beside each other.
    known_ns : int
        The picture that made it improbable enough that they are free.
    tray, cycle : int
    tracks : ndarray of int32, (2,)
    joins : bool
        Whether the merge made bodies fewer; False for two beads of the same body, or of a body
        that only appeared as two.
    """

    stamp_ns: int
    known_ns: int
    tray: int
    cycle: int
    tracks: NDArray[np.int32]
    joins: bool

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyEstimate:
    """Free bodies of one tray: single beads, and clusters of beads that stick together.

    Errors hold beads that are not seen and pairs of which it is not known yet.

    Parameters
    ----------
    stamp_ns : int
        The instant that is counted, some time before it was published.
    tray, cycle : int
    beads : int
        In the tray.
    followed : int
        Of these, known at that instant; numbers of bodies are scaled to all beads.
    bodies : Measured
    mean_size : Measured
        Beads of a body: mean over the bodies.
    weighted_size : Measured
        Beads of the body of a bead: mean over the beads.
    clustered_share : Measured, 0 to 1
        Of the beads, in bodies of two and more.
    clusters : Measured
        Bodies of two and more beads.
    sizes : ndarray (5,)
        Bodies of 1, 2, 3, 4 to 6, and 7 or more beads.
    first_merge_ns : int or None
        When the first two beads of the cycle began to stick together; None before.
    """

    stamp_ns: int
    tray: int
    cycle: int
    beads: int
    followed: int
    bodies: Measured
    mean_size: Measured
    weighted_size: Measured
    clustered_share: Measured
    clusters: Measured
    sizes: NDArray[np.float64]
    first_merge_ns: int | None = None

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def merged(self) -> bool:
        """Whether any beads stick together in this cycle."""
        return self.first_merge_ns is not None
