"""Read access to a gas: beads, bodies, event counts and ledger.

Tested by ``test/simulation/engine/test_reference_agreement.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.event_counts import EventCounts
from nanorocks_ros.simulation.engine.event_loop import snapshot
from nanorocks_ros.simulation.engine.flight.drag_rates import OWN_RATE
from nanorocks_ros.simulation.engine.gas_state import (
    BODY,
    EPOCH,
    FLAGS,
    INERTIA,
    NOW,
    ORIGINAL,
    SPECIES,
)
from nanorocks_ros.simulation.engine.kernel_choice import Kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules


class GasView:
    """Read access to the state of a gas, by the original numbers of the beads."""

    _state: State
    _rules: Rules

    @property
    def now(self) -> float:
        """Present time of the gas, [s]."""
        return float(self._state.clock[EPOCH] + self._state.clock[NOW])

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._by_number(self._state.rows[:, 7])

    @property
    def masses(self) -> NDArray[np.float64]:
        """Mass of each bead, (n,), [kg]."""
        return self._by_number(self._state.masses[:, 0])

    @property
    def drag(self) -> NDArray[np.float64] | None:
        """Rate at which the gas slows each bead, (n,), [1/s]; None without drag."""
        if not self._state.drag.size:
            return None
        return self._by_number(self._state.drag[:, OWN_RATE])

    @property
    def bodies(self) -> NDArray[np.int32]:
        """The smallest number of a bead in the body of each bead, (n,)."""
        if not self._rules.sticky:
            return np.arange(self._state.rows.shape[0], dtype=np.int32)
        return self._by_number(self._state.bodies[:, BODY])

    @property
    def stuck(self) -> NDArray[np.bool_]:
        """Whether each bead is stuck to a wall, by itself or in a body, (n,)."""
        if not self._rules.sticky:
            return np.zeros(self._state.rows.shape[0], dtype=np.bool_)
        stuck: NDArray[np.bool_] = np.isinf(self._state.masses[self.bodies, 1])
        return stuck

    @property
    def kernel(self) -> Kernel:
        """The kernel in use."""
        return Kernel.LISTS if self._state.references.shape[0] else Kernel.SCAN

    @property
    def counts(self) -> EventCounts:
        """Events so far."""
        return EventCounts.of(self._state.counts)

    @property
    def ledger(self) -> NDArray[np.float64]:
        """Energy, momentum and angular momentum that left the beads, (18,), SI.

        Energy lost in pair collisions, at walls (gained from moving walls: negative) and in
        merges and break-ups; normal momentum given to each of the six walls; momentum and angular
        momentum about the origin given to walls and to what sticks to them; angular momentum
        taken by aggregates that cannot turn, and by smooth beads that leave one that turns and
        lose their spin. Angular momentum is booked for rough and sticky beads.
        """
        return self._state.ledger.copy()

    @property
    def spins(self) -> NDArray[np.float64]:
        """Angular velocity of each bead, (n, 3), [rad/s].

        Of rough beads; of beads of bodies that turn, that of the body; otherwise 0.
        """
        n = self._state.rows.shape[0]
        positions, velocities, spins = np.empty((3, n, 3))
        snapshot(self._state, self._rules, positions, velocities, spins)
        return spins

    @property
    def energy(self) -> float:
        """Kinetic energy of all beads, of translation and rotation, [J]."""
        spins, v = self.spins, self.beads().velocities
        inertias = INERTIA * self.masses * self.radii**2
        return float(0.5 * (self.masses @ (v * v).sum(axis=1) + inertias @ (spins**2).sum(axis=1)))

    @property
    def momentum(self) -> NDArray[np.float64]:
        """Momentum of all beads, (3,), [kg m/s]."""
        return np.asarray(self.masses @ self.beads().velocities)

    @property
    def angular_momentum(self) -> NDArray[np.float64]:
        """Angular momentum of all beads about the origin, (3,), [kg m^2/s]."""
        beads = self.beads()
        inertias = INERTIA * self.masses * self.radii**2
        orbital = np.cross(beads.positions, self.masses[:, np.newaxis] * beads.velocities)
        return np.asarray(orbital.sum(axis=0) + inertias @ self.spins)

    @property
    def bytes_per_bead(self) -> float:
        """Memory in use for each bead."""
        return sum(array.nbytes for array in self._state) / self._state.rows.shape[0]

    def _by_number(self, values: NDArray[Any]) -> NDArray[Any]:
        ordered = np.empty_like(values)
        ordered[self._state.links[:, ORIGINAL]] = values
        return ordered

    def beads(self) -> Beads:
        """The beads at the present time."""
        n = self._state.rows.shape[0]
        positions, velocities = np.empty((2, n, 3))
        spins = np.empty((n if self._rules.rough else 0, 3))
        snapshot(self._state, self._rules, positions, velocities, spins)
        return Beads(
            radii=self.radii,
            masses=self.masses,
            positions=positions,
            velocities=velocities,
            spins=spins if self._rules.rough else None,
            species=self._by_number(self._state.links[:, FLAGS] >> SPECIES),
            drag=self.drag,
        )
