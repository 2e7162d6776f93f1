"""Granular temperature of a tray: energy of each species, and local temperature at each bead.

Tested by ``test/stages/bodies/test_body_counter.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.stable_sort import stable_argsort

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Number of neighbours in a local temperature, and its smallest ratio to the mean: beads that stick
# together move alike and look cold.
_N_NEIGHBOURS = 12
_MIN_RATIO = 0.1
# Weight of a frame in the exponential mean of the energy.
_ENERGY_WEIGHT = 0.2


@compiled
def _energy(velocity: NDArray[np.float64], error: float, radius: float) -> float:
    """Energy of a bead per component, less the contribution of errors, over its density.

    In [m^5/s^2]; NaN for an unknown velocity.
    """
    square = 0.5 * (velocity[0] * velocity[0] + velocity[1] * velocity[1])
    return float((square - error * error) * (radius * radius * radius))


@compiled
def update_energies(
    velocities: NDArray[np.float64],
    velocity_errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
    energies: NDArray[np.float64],
) -> float:
    """Update the mean energy of each species; return the mean speed of visible beads, [m/s].

    Parameters
    ----------
    velocities : ndarray (n, 2), [m/s]
        NaN if unknown, as are their errors; such beads count as resting in the mean speed.
    velocity_errors, radii : ndarray (n,), [m/s], [m]
    species : ndarray of int32, (n,)
    seen : ndarray of bool, (n,)
    energies : ndarray (species,), [m^5/s^2]
        Mean of `_energy`; changed for species with known velocities.
    """
    counts, sums = np.zeros(energies.size, dtype=np.int64), np.zeros(energies.size)
    speed, n_seen = 0.0, 0
    for k in range(species.size):
        if not seen[k]:
            continue
        n_seen += 1
        u, v = velocities[k]
        bead_speed = math.sqrt(u * u + v * v)
        speed += bead_speed if bead_speed == bead_speed else 0.0
        energy = _energy(velocities[k], velocity_errors[k], radii[k])
        if abs(energy) < np.inf:
            counts[species[k]] += 1
            sums[species[k]] += energy
    for k in range(energies.size):
        if counts[k]:
            last = energies[k]
            weight = _ENERGY_WEIGHT if last > 0.0 else 1.0
            energies[k] = last + weight * (max(sums[k] / counts[k], 0.0) - last)
    return speed / max(n_seen, 1)


@compiled
def select_seen(
    energies: NDArray[np.float64],
    ids: NDArray[np.int64],
    positions: NDArray[np.float64],
    position_errors: NDArray[np.float64],
    velocities: NDArray[np.float64],
    velocity_errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    radius_errors: NDArray[np.float64],
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
    equal_sizes: NDArray[np.bool_],
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
]:
    """Select the visible beads, sorted by number.

    Parameters
    ----------
    energies, positions, velocities, velocity_errors, radii, species, seen
        As in `velocity_variances`.
    ids : ndarray of int64, (n,)
    position_errors, radius_errors : ndarray (n,), [m]
    equal_sizes : ndarray of bool, (species,)
        Species whose beads have one known size: their radius error is set to 0.

    Returns
    -------
    rows : ndarray of int64, (k,)
        Rows of the visible beads.
    ids, positions, velocity_errors, radii, radius_errors, velocity_variances
        As in `nanorocks_ros.stages.bodies.touching_pairs.SeenBeads`.
    """
    variances = velocity_variances(
        energies, positions, velocities, velocity_errors, radii, species, seen
    )
    rows = np.flatnonzero(seen)
    rows = rows[stable_argsort(ids[rows])]
    measured = radius_errors[rows]
    for k in range(rows.size):
        if equal_sizes[species[rows[k]]]:
            measured[k] = 0.0
    return (
        rows,
        ids[rows],
        positions[rows],
        position_errors[rows],
        radii[rows],
        measured,
        variances[rows],
    )


@compiled
def velocity_variances(
    energies: NDArray[np.float64],
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    velocity_errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Mean square of a velocity component of a free bead at the position of each bead, (n,).

    An inelastic gas is colder where it is denser, and there free beads stay together longer.

    Parameters
    ----------
    energies : ndarray (species,), [m^5/s^2]
        Mean energies of `update_energies`.
    positions : ndarray (n, 2), [m]
    velocities, velocity_errors, radii, species, seen
        As in `update_energies`.
    """
    n = species.size
    ratios, rows, count = np.empty(n), np.empty(n, dtype=np.int64), 0
    variances = np.empty(n)
    for k in range(n):
        mean_energy = energies[species[k]]
        variances[k] = mean_energy / (radii[k] * radii[k] * radii[k])
        energy = _energy(velocities[k], velocity_errors[k], radii[k])
        ratio = energy / mean_energy if mean_energy > 0.0 else 0.0 * energy
        if seen[k] and abs(ratio) < np.inf:
            rows[count], ratios[count] = k, ratio
            count += 1
    if count <= _N_NEIGHBOURS:
        return variances
    # Sorted by column, so that only beads nearby are compared.
    columns = positions[rows[:count], 0].copy()
    order = stable_argsort(columns)
    columns, rows, ratios = columns[order], rows[order], ratios[order]
    squared_distances, nearest_ratios = np.empty(_N_NEIGHBOURS), np.empty(_N_NEIGHBOURS)
    for k in range(n):
        squared_distances[:] = np.inf
        right = np.searchsorted(columns, positions[k, 0])
        left = right - 1
        while True:
            to_left = positions[k, 0] - columns[left] if left >= 0 else np.inf
            to_right = columns[right] - positions[k, 0] if right < count else np.inf
            column_step = min(to_left, to_right)
            if column_step * column_step >= squared_distances[-1]:
                break
            neighbour = left if to_left < to_right else right
            left -= to_left < to_right
            right += to_left >= to_right
            row_step = positions[rows[neighbour], 1] - positions[k, 1]
            _insert_neighbour(
                squared_distances,
                nearest_ratios,
                column_step * column_step + row_step * row_step,
                ratios[neighbour],
            )
        variances[k] *= min(max(nearest_ratios.mean(), _MIN_RATIO), 1.0)
    return variances


@compiled
def _insert_neighbour(
    squared_distances: NDArray[np.float64],
    nearest_ratios: NDArray[np.float64],
    square: float,
    ratio: float,
) -> None:
    """Insert a bead into the list of nearest neighbours, sorted by squared distance."""
    if square >= squared_distances[-1]:
        return
    slot = squared_distances.size - 1
    while slot > 0 and squared_distances[slot - 1] > square:
        squared_distances[slot], nearest_ratios[slot] = (
            squared_distances[slot - 1],
            nearest_ratios[slot - 1],
        )
        slot -= 1
    squared_distances[slot], nearest_ratios[slot] = square, ratio
