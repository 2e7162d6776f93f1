"""Haff's law fitted to each species of a mixture by itself.

In a gas that has forgotten its start all species cool at one rate, so that they share a Haff time,
but not their energy: an inelastic mixture has no equipartition.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.haff_fit import fit_haff

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import SpeedEstimate

# Names of the species in a SpeedEstimate, in the order of `Tray.species`.
SPECIES = ('first', 'second')


def species_decays(
    tray: Tray, time: NDArray[np.float64], speeds: Sequence[SpeedEstimate], fewest: int
) -> dict[str, float]:
    """Initial speed and Haff time of each species, as fields of a CorEstimate.

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
    dict of str to float
        ``first_species_initial_speed`` and ``first_species_haff_time``, each with its error
        (``..._error``), and the same of the second species. Species whose speeds are unknown
        or do not fall are left out; empty for a tray with a single species.
    """
    fields: dict[str, float] = {}
    if len(tray.species) < 2:
        return fields
    for name, species in zip(SPECIES, tray.species, strict=False):
        speed = np.array([getattr(estimate, f'{name}_species_speed') for estimate in speeds])
        error = np.array([getattr(estimate, f'{name}_species_speed_error') for estimate in speeds])
        known = np.isfinite(speed) & np.isfinite(error) & (speed > 0.0) & (error > 0.0)
        if int(known.sum()) < fewest:
            continue
        try:
            fit = fit_haff(time[known], speed[known], error[known], species.count)
        except FitError:
            continue
        fields[f'{name}_species_initial_speed'] = fit.initial_speed
        fields[f'{name}_species_initial_speed_error'] = fit.initial_speed_error
        fields[f'{name}_species_haff_time'] = fit.haff_time
        fields[f'{name}_species_haff_time_error'] = fit.haff_time_error
    return fields
