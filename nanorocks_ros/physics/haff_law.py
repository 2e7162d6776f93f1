"""Haff's law: decay of the mean speed of a freely cooling granular gas.

Tested by ``test/physics/test_paper_formulas.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def haff_speed(
    time: NDArray[np.float64], initial_speed: float, haff_time: float
) -> NDArray[np.float64]:
    """Mean speed of a gas that cools by Haff's law, v = v0 / (1 + t/tau).

    Parameters
    ----------
    time : ndarray, [s]
        Since the start of the cooling.
    initial_speed : float, [m/s]
    haff_time : float, [s]

    References
    ----------
    Haff 1983, J. Fluid Mech. 134, 401; [B19] eq. 3 for the square of it.
    """
    return initial_speed / (1.0 + np.asarray(time) / haff_time)


def granular_energy(speed: float, mass: float) -> float:
    """Kinetic energy per particle in the paper, T = m v^2 / 2 [J] ([B19] eq. 4)."""
    return 0.5 * mass * speed * speed
