"""How warm the gas of a tray is, on the whole and around each bead."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# So many beads make the surroundings of one; they are not taken for colder than this, against
# the gas, since beads that stick together move alike.
_NEIGHBOURS = 12
_COLDEST = 0.1
# Share of a new mean energy taken over in each picture.
_ENERGY_SHARE = 0.2


@compiled
def _excess(velocity: NDArray[np.float64], error: float, radius: float) -> float:
    """Energy of a component of the motion of a bead, less what errors add.

    Up to the density, which beads of a species share, [m^5/s^2]; NaN when it is not known.
    """
    square = 0.5 * (velocity[0] * velocity[0] + velocity[1] * velocity[1])
    return float((square - error * error) * (radius * radius * radius))


@compiled
def learn_energies(
    velocities: NDArray[np.float64],
    errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
    energies: NDArray[np.float64],
) -> float:
    """Follow the mean energy of each species; mean speed of all beads that are seen, [m/s].

    Parameters
    ----------
    velocities : ndarray (n, 2), [m/s]
        NaN where not known, as are their errors; such beads count as resting in the mean speed.
    errors, radii : ndarray (n,), [m/s], [m]
    species : ndarray of int32, (n,)
    seen : ndarray of bool, (n,)
    energies : ndarray (species,), [m^5/s^2]
        Of a component, less what errors add, as of `_excess`; changed where beads are known.
    """
    known, sums = np.zeros(energies.size, dtype=np.int64), np.zeros(energies.size)
    speed, beads = 0.0, 0
    for k in range(species.size):
        if not seen[k]:
            continue
        beads += 1
        u, v = velocities[k]
        own = math.sqrt(u * u + v * v)
        speed += own if own == own else 0.0
        energy = _excess(velocities[k], errors[k], radii[k])
        if abs(energy) < np.inf:
            known[species[k]] += 1
            sums[species[k]] += energy
    for k in range(energies.size):
        if known[k]:
            last = energies[k]
            share = _ENERGY_SHARE if last > 0.0 else 1.0
            energies[k] = last + share * (max(sums[k] / known[k], 0.0) - last)
    return speed / max(beads, 1)


@compiled
def of_seen(
    usual: NDArray[np.float64],
    ids: NDArray[np.int64],
    places: NDArray[np.float64],
    place_errors: NDArray[np.float64],
    velocities: NDArray[np.float64],
    errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    radius_errors: NDArray[np.float64],
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
    alike: NDArray[np.bool_],
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
]:
    """The beads that are seen, in the order of their numbers.

    Parameters
    ----------
    usual, places, velocities, errors, radii, species, seen
        As of `variances`.
    ids : ndarray of int64, (n,)
    place_errors, radius_errors : ndarray (n,), [m]
    alike : ndarray of bool, (species,)
        Whose beads are all of one size, which is known better than measured.

    Returns
    -------
    rows : ndarray of int64, (k,)
        Which beads these are.
    ids, places, errors, radii, radius_errors, variances
        As in `nanorocks_ros.stages.bodies.bond_kernels.Beads`.
    """
    found = variances(usual, places, velocities, errors, radii, species, seen)
    rows = np.flatnonzero(seen)
    rows = rows[np.argsort(ids[rows], kind='mergesort')]
    measured = radius_errors[rows]
    for k in range(rows.size):
        if alike[species[rows[k]]]:
            measured[k] = 0.0
    return (
        rows,
        ids[rows],
        places[rows],
        place_errors[rows],
        radii[rows],
        measured,
        found[rows],
    )


@compiled
def variances(
    usual: NDArray[np.float64],
    places: NDArray[np.float64],
    velocities: NDArray[np.float64],
    errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Mean square of a component of the velocity that a bead has in this gas, there, (n,).

    A gas of inelastic beads is cold where it is dense, and there beads stay together.

    Parameters
    ----------
    usual : ndarray (species,), [m^5/s^2]
        Energies of `learn_energies`, followed from picture to picture.
    places : ndarray (n, 2), [m]
    velocities, errors, radii, species, seen
        As there.
    """
    n = species.size
    ratios, known, beads = np.empty(n), np.empty(n, dtype=np.int64), 0
    found = np.empty(n)
    for k in range(n):
        own = usual[species[k]]
        found[k] = own / (radii[k] * radii[k] * radii[k])
        excess = _excess(velocities[k], errors[k], radii[k])
        ratio = excess / own if own > 0.0 else 0.0 * excess
        if seen[k] and abs(ratio) < np.inf:
            known[beads], ratios[beads] = k, ratio
            beads += 1
    if beads <= _NEIGHBOURS:
        return found
    # From left to right, so that only those beside a bead are looked at.
    across = places[known[:beads], 0].copy()
    order = np.argsort(across)
    across, known, ratios = across[order], known[order], ratios[order]
    near, those = np.empty(_NEIGHBOURS), np.empty(_NEIGHBOURS)
    for k in range(n):
        near[:] = np.inf
        right = np.searchsorted(across, places[k, 0])
        left = right - 1
        while True:
            to_left = places[k, 0] - across[left] if left >= 0 else np.inf
            to_right = across[right] - places[k, 0] if right < beads else np.inf
            step = min(to_left, to_right)
            if step * step >= near[-1]:
                break
            next_one = left if to_left < to_right else right
            left -= to_left < to_right
            right += to_left >= to_right
            down = places[known[next_one], 1] - places[k, 1]
            _insert(near, those, step * step + down * down, ratios[next_one])
        found[k] *= min(max(those.mean(), _COLDEST), 1.0)
    return found


@compiled
def _insert(
    near: NDArray[np.float64], those: NDArray[np.float64], square: float, ratio: float
) -> None:
    """Add a bead at a square distance to the nearest ones, with its ratio."""
    if square >= near[-1]:
        return
    place = near.size - 1
    while place > 0 and near[place - 1] > square:
        near[place], those[place] = near[place - 1], those[place - 1]
        place -= 1
    near[place], those[place] = square, ratio
