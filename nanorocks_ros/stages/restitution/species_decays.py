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

# Those whose speeds a SpeedEstimate holds, in the order of `Tray.species`.
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
        (``..._error``), and the same of the second species. Left out are species whose
        speeds are not known or do not fall, and a tray with a single species.
    """
    found: dict[str, float] = {}
    if len(tray.species) < 2:
        return found
    for name, species in zip(SPECIES, tray.species, strict=False):
        speed = np.array([getattr(one, f'{name}_species_speed') for one in speeds])
        error = np.array([getattr(one, f'{name}_species_speed_error') for one in speeds])
        known = np.isfinite(speed) & np.isfinite(error) & (speed > 0.0) & (error > 0.0)
        if int(known.sum()) < fewest:
            continue
        try:
            fit = fit_haff(time[known], speed[known], error[known], species.count)
        except FitError:
            continue
        found[f'{name}_species_initial_speed'] = fit.initial_speed
        found[f'{name}_species_initial_speed_error'] = fit.initial_speed_error
        found[f'{name}_species_haff_time'] = fit.haff_time
        found[f'{name}_species_haff_time_error'] = fit.haff_time_error
    return found
