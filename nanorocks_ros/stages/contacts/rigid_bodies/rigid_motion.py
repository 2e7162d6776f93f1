"""Free motion of a rigid body of beads, and what an impulse changes of it.

Tested by ``test/stages/contacts/test_body_rebounds.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Moment of inertia of a sphere over mass times radius squared.
_SPHERE = 0.4
# Largest angle of a step along a rotation, [rad]: its error is 1e-5 of the arms at most.
_ANGLE = 0.25


@compiled
def inertia_of(
    arms: NDArray[np.float64], shares: NDArray[np.float64], radii: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Tensor of inertia of spheres about their centre of mass over their mass, (3, 3), [m^2].

    Parameters
    ----------
    arms : ndarray (m, 3), [m]
    shares : ndarray (m,)
        Of the spheres in the mass.
    radii : ndarray (m,), [m]
    """
    inertia = np.zeros((3, 3))
    for k in range(shares.size):
        square = _SPHERE * radii[k] * radii[k]
        for i in range(3):
            square += arms[k, i] * arms[k, i]
        for i in range(3):
            inertia[i, i] += shares[k] * square
            for j in range(3):
                inertia[i, j] -= shares[k] * arms[k, i] * arms[k, j]
    return inertia


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
    # The impulse passes through the centre of the bead.
    arm, push = arms[bead], impulse * normal
    turn = np.array(
        [
            arm[1] * push[2] - arm[2] * push[1],
            arm[2] * push[0] - arm[0] * push[2],
            arm[0] * push[1] - arm[1] * push[0],
        ]
    )
    return velocity + push[:2], spin + np.linalg.solve(inertia_of(arms, shares, radii), turn)


@compiled
def move_freely(
    body: tuple[NDArray[np.float64], NDArray[np.float64]],
    masses: tuple[NDArray[np.float64], NDArray[np.float64]],
    motion: tuple[NDArray[np.float64], NDArray[np.float64]],
    since: NDArray[np.float64],
    places: NDArray[np.float64],
) -> None:
    """Write the projected places (n, m, 2) of a body that moves freely.

    Its angular momentum is constant; its spin is not, where it has more than two beads.

    Parameters
    ----------
    body : tuple of ndarray (2,) and ndarray (m, 3)
        Centre and arms of the beads at the time 0.
    masses : tuple of 2 ndarrays (m,)
        Shares of the beads in the mass, and their radii.
    motion : tuple of ndarray (2,) and ndarray (3,)
        Velocity, and spin at the time 0.
    since : ndarray (n,), [s]
        Rising.
    places : ndarray (n, m, 2)
        Written.
    """
    (centre, arms), (shares, radii), (velocity, spin) = body, masses, motion
    inertia = inertia_of(arms, shares, radii)
    momentum = inertia @ spin
    inverse = np.linalg.inv(inertia)
    turned, slopes = np.empty((3, 3)), np.empty((5, 3, 3))
    # From the time 0 on, to either side.
    last = int(np.searchsorted(since, 0.0))
    for side in range(2):
        for i in range(3):
            for j in range(3):
                turned[i, j] = 1.0 if i == j else 0.0
        time = 0.0
        count = since.size - last if side else last
        for number in range(count):
            n = last + number if side else last - 1 - number
            _turn(turned, inverse, momentum, since[n] - time, slopes)
            time = since[n]
            for k in range(len(arms)):
                for i in range(2):
                    place = centre[i] + velocity[i] * time
                    for j in range(3):
                        place += turned[i, j] * arms[k, j]
                    places[n, k, i] = place


@compiled
def _turn(
    turned: NDArray[np.float64],
    inverse: NDArray[np.floating[Any]],
    momentum: NDArray[np.float64],
    time: float,
    slopes: NDArray[np.float64],
) -> None:
    """Turn a rotation (3, 3) on for a time, [s], by the fourth-order rule of Runge and Kutta.

    Parameters
    ----------
    turned : ndarray (3, 3)
        From the time 0; changed.
    inverse : ndarray (3, 3)
        Of the tensor of inertia at the time 0.
    momentum : ndarray (3,)
        Angular momentum.
    time : float, [s]
        Negative back in time.
    slopes : ndarray (5, 3, 3)
        Written: the last one is where a slope is taken.
    """
    trial = slopes[4]
    _write_slope(turned, inverse, momentum, slopes[0])
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += slopes[0, i, j] * slopes[0, i, j]
    steps = 1 + int(abs(time) * math.sqrt(0.5 * square) / _ANGLE)
    step = time / steps
    for number in range(steps):
        if number:
            _write_slope(turned, inverse, momentum, slopes[0])
        for stage in range(1, 4):
            part = step if stage == 3 else 0.5 * step
            for i in range(3):
                for j in range(3):
                    trial[i, j] = turned[i, j] + part * slopes[stage - 1, i, j]
            _write_slope(trial, inverse, momentum, slopes[stage])
        for i in range(3):
            for j in range(3):
                middle = slopes[1, i, j] + slopes[2, i, j]
                turned[i, j] += step / 6.0 * (slopes[0, i, j] + 2.0 * middle + slopes[3, i, j])


@compiled
def _write_slope(
    turned: NDArray[np.float64],
    inverse: NDArray[np.floating[Any]],
    momentum: NDArray[np.float64],
    slope: NDArray[np.float64],
) -> None:
    """Write the change (3, 3) of a rotation, [1/s]: the spin follows from the momentum."""
    x, y, z = 0.0, 0.0, 0.0
    for j in range(3):
        # Of the spin in axes that turn with the body.
        own = 0.0
        for k in range(3):
            along = 0.0
            for i in range(3):
                along += turned[i, k] * momentum[i]
            own += inverse[j, k] * along
        x += turned[0, j] * own
        y += turned[1, j] * own
        z += turned[2, j] * own
    for j in range(3):
        slope[0, j] = y * turned[2, j] - z * turned[1, j]
        slope[1, j] = z * turned[0, j] - x * turned[2, j]
        slope[2, j] = x * turned[1, j] - y * turned[0, j]
