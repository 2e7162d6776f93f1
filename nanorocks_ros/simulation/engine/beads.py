"""Beads at one instant: sizes, positions, velocities, spins and species.

Tested by ``test/simulation/engine/test_input_checks.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Beads:
    """Beads at one instant.

    Parameters
    ----------
    radii, masses : ndarray (n,), [m], [kg], > 0
    positions, velocities : ndarray (n, 3), [m], [m/s]
    spins : ndarray (n, 3) or None, [rad/s]
        Angular velocities; None: no rotation.
    species : ndarray of int, (n,), or None
        From 0; None: all alike.
    drag : ndarray (n,) or None, [1/s], >= 0
        Rate at which a gas at rest slows each bead; spins decay 10/3 times as fast, as those of
        solid spheres. None, or all 0: no gas.
    """

    radii: NDArray[np.float64]
    masses: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64] | None = None
    species: NDArray[np.int32] | None = None
    drag: NDArray[np.float64] | None = None
