"""Beads at random places in a tray, without overlap: what no clusters look like.

Tested by ``test/studies/gas_statistics/test_structure_factors.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.initial_state import inventory, resting_beads

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Beads in all arrangements together, and limits of the number of arrangements.
_BEADS, _FEWEST, _MOST = 8000, 20, 400


class Places(NamedTuple):
    """Projected places of the beads of a tray at one time.

    Parameters
    ----------
    positions : ndarray (n, 2), [m]
        From the corner of the tray.
    species : ndarray of int, (n,)
    """

    positions: NDArray[np.float64]
    species: NDArray[np.int32]


def random_arrangements(tray: Tray) -> list[Places]:
    """Independent arrangements of all beads of a tray, always the same.

    Parameters
    ----------
    tray : Tray

    Raises
    ------
    SimulationError
        When the beads do not fit.
    """
    number = min(max(_BEADS // tray.count, _FEWEST), _MOST)
    species = np.asarray(inventory(tray).species, dtype=np.int32)
    settings = SimulationSettings()
    return [
        Places(resting_beads(settings, tray, run).positions[:, :2], species)
        for run in range(number)
    ]
