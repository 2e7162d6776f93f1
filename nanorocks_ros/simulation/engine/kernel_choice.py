"""Choice between scan and neighbour lists, and the state arranged for it.

Tested by ``test/simulation/engine/neighbours/test_neighbour_lists.py``.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.simulation.engine.flight.turning_motion import new_motions
from nanorocks_ros.simulation.engine.gas_state import BODY, ORIGINAL, State, new_state
from nanorocks_ros.simulation.engine.neighbours.list_tuning import (
    list_skin,
    with_lists,
    z_order,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# From so many beads on lists are faster (`python -m benchmarks engine`).
MOST_FOR_SCAN = 32


class Kernel(IntEnum):
    """How the next event of a bead is predicted."""

    AUTOMATIC = 0
    SCAN = 1
    LISTS = 2


def arranged_state(
    checked: tuple[NDArray[np.float64], ...],
    details: tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]],
    rules: Rules,
    kernel: Kernel,
) -> State:
    """The state for a kernel, with the beads in the order that suits it.

    Parameters
    ----------
    checked : tuple of ndarray
        Radii, masses, positions and velocities, see `check_beads`.
    details : tuple of ndarray
        Species (n,); spins (n, 3) or (0, 3), [rad/s]; drag (n, 2) or (0,), [1/s].
    rules : Rules
    kernel : Kernel

    Raises
    ------
    SimulationError
        For lists in a periodic box that is too small for them.
    """
    radii, masses, positions, velocities = checked
    species, spins, drag = details
    skin = list_skin(radii, rules)
    if kernel == Kernel.LISTS and not skin:
        raise SimulationError(
            'kernel', 'the periodic box is too small for lists', 'use the scan, or a larger box'
        )
    listed = kernel == Kernel.LISTS or (
        kernel == Kernel.AUTOMATIC and radii.size > MOST_FOR_SCAN and skin > 0.0
    )
    order = np.arange(radii.size)
    if listed:
        order = z_order(positions, 2.0 * float(radii.max()) + skin)
    fields = _new_fields(
        positions[order],
        velocities[order],
        radii[order],
        masses[order],
        species[order],
        drag[order] if drag.size else drag,
        new_motions(radii.size, rules),
        rules,
    )
    state = State(*fields)
    state.links[:, ORIGINAL] = order
    if spins.shape[0]:
        state.spins[:] = spins[order]
    if rules.sticky:
        state.masses[:, 1] = masses
        state.bodies[:, BODY] = order
    return with_lists(state, rules, skin) if listed else state


@compiled
def _new_fields(
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    radii: NDArray[np.float64],
    masses: NDArray[np.float64],
    species: NDArray[np.int32],
    drag: NDArray[np.float64],
    motions: NDArray[np.float64],
    rules: Rules,
) -> tuple[Any, ...]:
    """Fields of `new_state`; see `compiled` for why not the state itself."""
    return new_state(positions, velocities, radii, masses, species, drag, motions, rules)[:]
