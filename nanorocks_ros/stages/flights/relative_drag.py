"""Stokes drag of the beads of a tray relative to one another.

Tested by ``test/stages/flights/test_free_flights.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.stokes_drag import stokes_rate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray


def relative_drags(tray: Tray) -> NDArray[np.float64]:
    """Drag of beads of mean size over that of the first species, (species,)."""
    return np.array(
        [relative_drag(tray, k, 0.5 * kind.diameter) for k, kind in enumerate(tray.species)]
    )


def relative_drag(tray: Tray, species: int, radius: float) -> float:
    """Drag of a bead over that of a bead of mean size of the first species.

    Parameters
    ----------
    tray : Tray
    species : int
    radius : float, [m]
    """
    first = tray.species[0]
    own = stokes_rate(1.0, _density(tray, species), 2.0 * radius)
    return own / stokes_rate(1.0, _density(tray, 0), first.diameter)


def _density(tray: Tray, species: int) -> float:
    """Density of a species, [kg/m^3]; where one is not known all count as alike."""
    alike = any(math.isnan(kind.density) for kind in tray.species)
    return 1.0 if alike else tray.species[species].density


def mean_relative_drag(tray: Tray) -> float:
    """Drag of the mean speed of a tray over that of a bead of the first species.

    It slows the gas of a mixture as if all beads had that drag, as long as their speeds do not
    drift apart by it.
    """
    counts = np.array([kind.count for kind in tray.species], dtype=np.float64)
    return float(relative_drags(tray) @ counts / counts.sum())
