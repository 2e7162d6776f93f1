"""Compiled residuals of a body that rebounds between two frames, and their derivatives.

The unknowns are the places of the beads at the contact (2 m) and their heights (m), velocity (2)
and spin (3) before, the impulse over the mass of the body, and the time of the contact.

Tested by ``test/stages/contacts/test_body_rebounds.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.contacts.rigid_bodies.rigid_motion import after_impulse, move_freely

# Error of the distance of two beads that touch, [m].
_BOND_ERROR = 2e-5


class SeenBody(NamedTuple):
    """What frames tell of a body that touches a wall; see `BodyFrames` of `rigid_rebound`.

    Parameters
    ----------
    times : ndarray (n,), [s]
    first : int
        Row of the first frame after the contact.
    positions : ndarray (n, m, 2), [m]
    weights : ndarray (n, m), [1/m]
        One over the errors.
    shares, radii : ndarray (m,)
        Of the beads in the mass; [m].
    bead : int
        That touches the wall.
    normal : ndarray (3,)
    spread : float, [m]
        Of the heights.
    bond : float, [m]
        Distance of the centres of two beads; NaN where there are more.
    """

    times: NDArray[np.float64]
    first: int
    positions: NDArray[np.float64]
    weights: NDArray[np.float64]
    shares: NDArray[np.float64]
    radii: NDArray[np.float64]
    bead: int
    normal: NDArray[np.float64]
    spread: float
    bond: float


def residuals_of(body: SeenBody, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deviations in their errors: of all positions, of the heights and of the bond of two beads.

    Parameters
    ----------
    body : SeenBody
    unknowns : ndarray (3 m + 7,)
    """
    residuals = np.empty(_count(body))
    _write_residuals(body, unknowns, residuals)
    return residuals


def derivatives_of(
    body: SeenBody, unknowns: NDArray[np.float64], steps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivatives of the residuals by the unknowns, (r, 3 m + 7), by central differences.

    Parameters
    ----------
    body, unknowns
        As of `residuals_of`.
    steps : ndarray (3 m + 7,)
        To either side.
    """
    derivatives = np.empty((_count(body), unknowns.size))
    _write_derivatives(body, unknowns, steps, derivatives)
    return derivatives


def _count(body: SeenBody) -> int:
    return body.positions.size + body.radii.size + (0 if math.isnan(body.bond) else 1)


@compiled
def arms_of(
    unknowns: NDArray[np.float64], shares: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre of mass in the projection (2,), and arms of the beads (m, 3), [m].

    Parameters
    ----------
    unknowns : ndarray (3 m + 7,)
    shares : ndarray (m,)
    """
    beads = shares.size
    centre, arms, height = np.zeros(2), np.empty((beads, 3)), 0.0
    for k in range(beads):
        for i in range(2):
            centre[i] += shares[k] * unknowns[2 * k + i]
        height += shares[k] * unknowns[2 * beads + k]
    for k in range(beads):
        for i in range(2):
            arms[k, i] = unknowns[2 * k + i] - centre[i]
        arms[k, 2] = unknowns[2 * beads + k] - height
    return centre, arms


@compiled
def _write_residuals(
    body: SeenBody, unknowns: NDArray[np.float64], residuals: NDArray[np.float64]
) -> None:
    """Write what `residuals_of` gives."""
    frames, beads = body.weights.shape
    centre, arms = arms_of(unknowns, body.shares)
    moves = unknowns[3 * beads :]
    velocity, spin = moves[:2], moves[2:5]
    turning = body.shares, body.radii, body.bead, body.normal
    after, spin_after = after_impulse(arms, velocity, spin, moves[5], turning)
    since = body.times - moves[6]
    count = 2 * frames * beads
    places = residuals[:count].reshape((frames, beads, 2))
    masses = body.shares, body.radii
    first = body.first
    move_freely((centre, arms), masses, (velocity, spin), since[:first], places[:first])
    move_freely((centre, arms), masses, (after, spin_after), since[first:], places[first:])
    for n in range(frames):
        for k in range(beads):
            for i in range(2):
                deviation = places[n, k, i] - body.positions[n, k, i]
                places[n, k, i] = deviation * body.weights[n, k]
    for k in range(beads):
        residuals[count + k] = unknowns[2 * beads + k] / body.spread
    if not math.isnan(body.bond):
        square = 0.0
        for i in range(3):
            square += (arms[1, i] - arms[0, i]) ** 2
        residuals[count + beads] = (math.sqrt(square) - body.bond) / _BOND_ERROR


@compiled
def _write_derivatives(
    body: SeenBody,
    unknowns: NDArray[np.float64],
    steps: NDArray[np.float64],
    derivatives: NDArray[np.float64],
) -> None:
    """Write what `derivatives_of` gives."""
    moved = unknowns.copy()
    low, high = np.empty(len(derivatives)), np.empty(len(derivatives))
    for u in range(unknowns.size):
        moved[u] = unknowns[u] + steps[u]
        _write_residuals(body, moved, high)
        moved[u] = unknowns[u] - steps[u]
        _write_residuals(body, moved, low)
        moved[u] = unknowns[u]
        for row in range(len(derivatives)):
            derivatives[row, u] = (high[row] - low[row]) / (2.0 * steps[u])
