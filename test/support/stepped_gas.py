"""A slow, independent gas with drag: Runge-Kutta steps, contacts by bisection of a step."""

from __future__ import annotations

import numpy as np

# The angular velocity of a solid sphere: torque 8 pi eta r^3 over 2/5 m r^2, in units of the
# rate 6 pi eta r / m.
TURNING = 10.0 / 3.0


class SteppedGas:
    """Beads in a box: drag is integrated step by step, contacts are those of rough spheres.

    Beads have the places, velocities, spins, radii, masses and decay rates of `Beads`; walls are
    smooth.
    """

    def __init__(self, beads, box, *, restitution, walls, tangential=None):
        self.x, self.v = beads.positions.copy(), beads.velocities.copy()
        self.spins = np.zeros_like(self.x) if beads.spins is None else beads.spins.copy()
        self.radii, self.masses, self.rates = beads.radii, beads.masses, beads.drag
        self.box, self.tangential = np.array(box), tangential
        self.restitution, self.walls = restitution, walls
        self.pairs = np.triu_indices(len(self.radii), 1)
        self.collisions = 0

    def follow(self, duration, step):
        """Follow the gas in steps of about this length."""
        steps = round(duration / step)
        for _ in range(steps):
            left = duration / steps
            while left > 0.0:
                left -= self._step(left)

    def _step(self, length):
        after = self._moved(length)
        if self._contact(after) is None:
            self._set(after)
            return length
        early, late = 0.0, length
        while late - early > 1e-15 * length and early < 0.5 * (early + late) < late:
            middle = 0.5 * (early + late)
            if self._contact(self._moved(middle)) is None:
                early = middle
            else:
                late = middle
        contact = self._moved(late)
        kind = self._contact(contact)
        self._set(contact)
        self._collide(*kind)
        return late

    def _set(self, state):
        self.x, self.v, self.spins = state

    def _moved(self, length):
        """Places, velocities and spins after one step of Runge and Kutta's, of order 4."""
        rates = self.rates[:, np.newaxis]

        def slope(state):
            return state[1], -rates * state[1], -TURNING * rates * state[2]

        def ahead(state, k, by):
            return tuple(a + by * b for a, b in zip(state, k, strict=True))

        start = self.x, self.v, self.spins
        k1 = slope(start)
        k2 = slope(ahead(start, k1, 0.5 * length))
        k3 = slope(ahead(start, k2, 0.5 * length))
        k4 = slope(ahead(start, k3, length))
        return tuple(
            s + length / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            for s, a, b, c, d in zip(start, k1, k2, k3, k4, strict=True)
        )

    def _contact(self, state):
        """An overlap of two approaching beads or of a bead with a wall, the first by number."""
        x, v, _ = state
        i, j = self.pairs
        apart, speed = x[j] - x[i], v[j] - v[i]
        touching = np.linalg.norm(apart, axis=1) < self.radii[i] + self.radii[j]
        closing = np.sum(apart * speed, axis=1) < 0.0
        for k in np.flatnonzero(touching & closing):
            return int(i[k]), int(j[k])
        radii = self.radii[:, np.newaxis]
        low, high = (x < radii) & (v < 0.0), (x > self.box - radii) & (v > 0.0)
        for bead, axis in np.argwhere(low | high):
            return int(bead), -1 - int(axis)
        return None

    def _collide(self, i, j):
        self.collisions += 1
        if j < 0:
            self.v[i, -1 - j] *= -self.walls
            return
        apart = self.x[j] - self.x[i]
        normal = apart / np.linalg.norm(apart)
        reduced = 1.0 / (1.0 / self.masses[i] + 1.0 / self.masses[j])
        turning = self.radii[i] * self.spins[i] + self.radii[j] * self.spins[j]
        slip = self.v[j] - self.v[i] - np.cross(turning, normal)
        along = slip @ normal
        impulse = -reduced * (1.0 + self.restitution) * along * normal
        if self.tangential is not None:
            across = slip - along * normal
            impulse -= reduced / 3.5 * (1.0 + self.tangential) * across
        self.v[i] -= impulse / self.masses[i]
        self.v[j] += impulse / self.masses[j]
        for k in (i, j):
            inertia = 0.4 * self.masses[k] * self.radii[k] ** 2
            self.spins[k] -= self.radii[k] / inertia * np.cross(normal, impulse)
