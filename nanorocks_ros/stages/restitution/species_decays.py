"""Haff's law fitted to each species of a mixture by itself.

In a gas that has forgotten its start all species cool at one rate, so that they share a Haff time,
but not their energy: an inelastic mixture has no equipartition.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.haff_fit import HaffFit, fit_haff
from nanorocks_ros.records import UNKNOWN_MEASURED, Measured

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import SpeedEstimate

# A SpeedEstimate holds the speeds of this many of `Tray.species`.
_SPECIES = 2


def species_decays(
    tray: Tray, time: NDArray[np.float64], speeds: Sequence[SpeedEstimate], fewest: int
) -> tuple[tuple[Measured, ...], tuple[Measured, ...]]:
    """Initial speed and Haff time of each of the first two species.

    Parameters
    ----------
    tray : Tray
    time : ndarray (n,), [s]
        Of the speeds, since the gas began to cool; rising.
    speeds : sequence of SpeedEstimate, (n,)
        Of the cooling window.
    fewest : int
        Speeds of a species that a fit needs.

    Returns
    -------
    initial_speeds, haff_times : tuple of Measured, [m/s], [s]
        Unknown for a species whose speeds are unknown or do not fall; empty for a tray with a
        single species.
    """
    if len(tray.species) < 2:
        return (), ()
    fits = [
        _fit(time, [_speed_of(estimate, place) for estimate in speeds], species.count, fewest)
        for place, species in enumerate(tray.species[:_SPECIES])
    ]
    initial_speeds = (
        Measured(fit.initial_speed, fit.initial_speed_error) if fit else UNKNOWN_MEASURED
        for fit in fits
    )
    haff_times = (
        Measured(fit.haff_time, fit.haff_time_error) if fit else UNKNOWN_MEASURED for fit in fits
    )
    return tuple(initial_speeds), tuple(haff_times)


def _speed_of(estimate: SpeedEstimate, place: int) -> Measured:
    speeds = estimate.species_speeds
    return speeds[place] if place < len(speeds) else UNKNOWN_MEASURED


def _fit(
    time: NDArray[np.float64], speeds: Sequence[Measured], count: int, fewest: int
) -> HaffFit | None:
    """Haff's law for one species; None where its speeds are not known or do not fall."""
    speed = np.array([measured.value for measured in speeds])
    error = np.array([measured.error for measured in speeds])
    known = np.isfinite(speed) & np.isfinite(error) & (speed > 0.0) & (error > 0.0)
    if int(known.sum()) < fewest:
        return None
    try:
        return fit_haff(time[known], speed[known], error[known], count)
    except FitError:
        return None
