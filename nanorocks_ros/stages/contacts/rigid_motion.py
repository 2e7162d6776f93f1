"""Free motion of a rigid body of beads, and what an impulse changes of it.

Tested by ``test/stages/contacts/test_body_rebounds.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Least rate of turning, [rad/s].
_LEAST_RATE = 1e-12
# Moment of inertia of a sphere over mass times radius squared.
_SPHERE = 0.4


@compiled
def after_impulse(
    arms: NDArray[np.float64],
    velocity: NDArray[np.float64],
    spin: NDArray[np.float64],
    impulse: float,
    body: tuple[NDArray[np.float64], NDArray[np.float64], int, NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity and spin of a body after an impulse over its mass.

    `body` holds the shares of the beads in its mass, their radii, which bead the impulse hits, and
    its direction.
    """
    shares, radii, bead, normal = body
    inertia = np.zeros((3, 3))
    for k in range(shares.size):
        square = _SPHERE * radii[k] * radii[k]
        for i in range(3):
            square += arms[k, i] * arms[k, i]
        for i in range(3):
            inertia[i, i] += shares[k] * square
            for j in range(3):
                inertia[i, j] -= shares[k] * arms[k, i] * arms[k, j]
    # The impulse passes through the centre of the bead.
    arm, push = arms[bead], impulse * normal
    turn = np.array(
        [
            arm[1] * push[2] - arm[2] * push[1],
            arm[2] * push[0] - arm[0] * push[2],
            arm[0] * push[1] - arm[1] * push[0],
        ]
    )
    return velocity + push[:2], spin + np.linalg.solve(inertia, turn)


@compiled
def move_freely(
    body: tuple[NDArray[np.float64], NDArray[np.float64]],
    motion: tuple[NDArray[np.float64], NDArray[np.float64]],
    since: NDArray[np.float64],
    places: NDArray[np.float64],
) -> None:
    """Write the projected places (n, m, 2) of a body that turns at a constant rate.

    Parameters
    ----------
    body : tuple of ndarray (2,) and ndarray (m, 3)
        Centre and arms of the beads at the time 0.
    motion : tuple of ndarray (2,) and ndarray (3,)
        Velocity and spin.
    since : ndarray (n,), [s]
    places : ndarray (n, m, 2)
        Written.
    """
    (centre, arms), (velocity, spin) = body, motion
    rate = math.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2])
    axis = spin / max(rate, _LEAST_RATE)
    for n in range(since.size):
        cosine, sine = math.cos(rate * since[n]), math.sin(rate * since[n])
        for k in range(len(arms)):
            along = arms[k, 0] * axis[0] + arms[k, 1] * axis[1] + arms[k, 2] * axis[2]
            for i in range(2):
                j, m = (i + 1) % 3, (i + 2) % 3
                across = axis[j] * arms[k, m] - axis[m] * arms[k, j]
                places[n, k, i] = (
                    centre[i]
                    + velocity[i] * since[n]
                    + cosine * arms[k, i]
                    + sine * across
                    + (1.0 - cosine) * along * axis[i]
                )
