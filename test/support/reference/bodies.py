"""Beads and rigid bodies of the reference engine."""

from __future__ import annotations

import numpy as np


class Bodies:
    """Positions, velocities and spins of all beads; a body shares one velocity, never turns.

    A body is called by the smallest bead number in it. A fixed body rests for ever.
    """

    def __init__(self, radii, masses, positions, velocities, spins=None):
        self.radii = np.array(radii, dtype=float)
        self.masses = np.array(masses, dtype=float)
        self.positions = np.array(positions, dtype=float)
        self.velocities = np.array(velocities, dtype=float)
        self.spins = np.zeros_like(self.positions) if spins is None else np.array(spins, float)
        self.inertias = 0.4 * self.masses * self.radii**2
        self.body = np.arange(len(self.radii))
        self.fixed = np.zeros(len(self.radii), dtype=bool)
        self.counts = np.zeros(len(self.radii), dtype=int)

    def members(self, i):
        return np.flatnonzero(self.body == self.body[i])

    def mass(self, i):
        """Mass of the whole body of bead i, fixed or not."""
        return self.masses[self.members(i)].sum()

    def per_mass(self, i):
        """1 / mass of the body of bead i: 0 when it is fixed."""
        return 0.0 if self.fixed[i] else 1.0 / self.mass(i)

    def per_inertia(self, i):
        """1 / moment of inertia of bead i: 0 unless it can turn, a moving body by itself."""
        turns = len(self.members(i)) == 1 and not self.fixed[i]
        return 1.0 / self.inertias[i] if turns else 0.0

    def energy(self, *beads):
        """Kinetic energy, turning included, of the different bodies these beads belong to."""
        chosen = np.isin(self.body, self.body[list(beads)])
        moving = 0.5 * self.masses[chosen] @ (self.velocities[chosen] ** 2).sum(axis=1)
        turning = 0.5 * self.inertias[chosen] @ (self.spins[chosen] ** 2).sum(axis=1)
        return moving + turning

    def momentum(self, i):
        """Momentum of the body of bead i."""
        return self.mass(i) * self.velocities[i]

    def advance(self, delay):
        self.positions += self.velocities * delay

    def count(self, *beads):
        """Note that the velocity of the bodies of these beads changed."""
        self.counts[np.isin(self.body, self.body[list(beads)])] += 1

    def push(self, i, impulse):
        """Give momentum to the body of bead i."""
        members = self.members(i)
        self.velocities[members] = self.velocities[i] + impulse * self.per_mass(i)

    def turn(self, i, normal, impulse):
        """Let an impulse at the contact turn bead i, as far as it can turn."""
        self.spins[i] -= self.radii[i] * self.per_inertia(i) * np.cross(normal, impulse)

    def set_velocity(self, i, axis, value):
        self.velocities[self.members(i), axis] = value

    def put(self, i, axis, coordinate):
        """Shift the body of bead i along an axis until the bead is at the coordinate."""
        self.positions[self.members(i), axis] += coordinate - self.positions[i, axis]
        self.positions[i, axis] = coordinate

    def join(self, i, j):
        """Make one body of the bodies of beads i and j; one fixed part fixes the whole."""
        if self.fixed[i] or self.fixed[j]:
            velocity, fixed = np.zeros(3), True
        else:
            together = self.mass(i) + self.mass(j)
            velocity, fixed = (self.momentum(i) + self.momentum(j)) / together, False
        members = np.union1d(self.members(i), self.members(j))
        self.body[members] = members.min()
        self.velocities[members] = velocity
        self.spins[members] = 0.0
        self.fixed[members] = fixed

    def fix(self, i):
        """Hold the body of bead i where it is, for ever."""
        members = self.members(i)
        self.velocities[members] = 0.0
        self.spins[members] = 0.0
        self.fixed[members] = True
