"""A slow, independent gas of rigid bodies: Runge-Kutta steps, contacts by bisection of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class _Body:
    """Beads, their arms in the frame of the body, and its motion."""

    beads: list[int]
    arms: np.ndarray
    inertia: np.ndarray
    mass: float
    centre: np.ndarray
    turn: np.ndarray
    velocity: np.ndarray
    moment: np.ndarray
    # Force per velocity of each bead, and torque per angular velocity about its own centre.
    friction: np.ndarray
    twist: np.ndarray

    def spin(self, turn, moment):
        return turn @ np.linalg.solve(self.inertia, turn.T @ moment)

    def moved(self, step):
        """Centre, orientation, velocity and angular momentum after a step, by Runge and Kutta."""
        start = np.concatenate([self.centre, self.velocity, self.moment, self.turn.ravel()])

        def slope(state):
            velocity, moment, turn = state[3:6], state[6:9], state[9:].reshape(3, 3)
            x, y, z = spin = self.spin(turn, moment)
            arms = self.arms @ turn.T
            forces = -self.friction[:, np.newaxis] * (velocity + np.cross(spin, arms))
            torque = np.cross(arms, forces).sum(axis=0) - self.twist.sum() * spin
            turning = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ turn
            change = velocity, forces.sum(axis=0) / self.mass, torque, turning.ravel()
            return np.concatenate(change)

        k1 = slope(start)
        k2 = slope(start + 0.5 * step * k1)
        k3 = slope(start + 0.5 * step * k2)
        k4 = slope(start + step * k3)
        end = start + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        # Nearest rotation, by one step of Newton's method.
        turn = end[9:].reshape(3, 3)
        turn = 1.5 * turn - 0.5 * turn @ turn.T @ turn
        return end[:3], turn, end[3:6], end[6:9]


class SteppedBodies:
    """Beads in a box that bounce, stick below a normal speed, and then turn as rigid bodies.

    Single beads are smooth. `events` lists time, kind, bead and partner as the engine does. The
    gas pulls at every bead by Stokes' law, as if the others were not there.
    """

    def __init__(self, beads, box, *, restitution, walls, sticking):
        self.radii, self.masses, self.box = beads.radii, beads.masses, np.array(box)
        self.restitution, self.walls, self.sticking = restitution, walls, sticking
        self.rates = np.zeros(len(self.radii)) if beads.drag is None else np.asarray(beads.drag)
        self.bodies = [
            self._body([i], x[np.newaxis], v, np.zeros(3))
            for i, (x, v) in enumerate(zip(beads.positions, beads.velocities, strict=True))
        ]
        self.pairs = np.triu_indices(len(self.radii), 1)
        self.time, self.events = 0.0, []

    def _body(self, beads, places, velocity, moment):
        masses = self.masses[beads]
        centre = masses @ places / masses.sum()
        arms = places - centre
        inertia = np.zeros((3, 3))
        for mass, radius, arm in zip(masses, self.radii[beads], arms, strict=True):
            inertia += (0.4 * mass * radius**2 + mass * arm @ arm) * np.eye(3)
            inertia -= mass * np.outer(arm, arm)
        friction = self.rates[beads] * masses
        # 8 pi eta r^3 for 6 pi eta r; a single bead does not spin.
        twist = 4.0 / 3.0 * friction * self.radii[beads] ** 2
        return _Body(
            beads,
            arms,
            inertia,
            masses.sum(),
            centre,
            np.eye(3),
            velocity,
            moment,
            friction,
            twist,
        )

    def follow(self, end, step):
        """Follow the gas to a time in steps of at most this length."""
        while self.time < end - 1e-12:
            self._step(min(step, end - self.time))

    def places_and_velocities(self, after=0.0):
        x, v = np.empty((2, len(self.radii), 3))
        for body in self.bodies:
            centre, turn, velocity, moment = body.moved(after)
            arms = body.arms @ turn.T
            x[body.beads] = centre + arms
            v[body.beads] = velocity + np.cross(body.spin(turn, moment), arms)
        return x, v

    def labels(self):
        labels = np.empty(len(self.radii), dtype=int)
        for body in self.bodies:
            labels[body.beads] = min(body.beads)
        return labels

    def _advance(self, step):
        for body in self.bodies:
            body.centre, body.turn, body.velocity, body.moment = body.moved(step)
        self.time += step

    def _step(self, length):
        labels = self.labels()
        if self._contact(length, labels) is None:
            self._advance(length)
            return
        early, late = 0.0, length
        while early < 0.5 * (early + late) < late:
            middle = 0.5 * (early + late)
            if self._contact(middle, labels) is None:
                early = middle
            else:
                late = middle
        contact = self._contact(late, labels)
        self._advance(late)
        self._collide(*contact)

    def _contact(self, after, labels):
        """An overlap of beads that approach, of two bodies or a body and a wall."""
        x, v = self.places_and_velocities(after)
        i, j = self.pairs
        apart = x[j] - x[i]
        touching = np.linalg.norm(apart, axis=1) < self.radii[i] + self.radii[j]
        closing = np.sum(apart * (v[j] - v[i]), axis=1) < 0.0
        for k in np.flatnonzero(touching & closing & (labels[i] != labels[j])):
            return int(i[k]), int(j[k])
        radii = self.radii[:, np.newaxis]
        for bead, axis in np.argwhere((x < radii) & (v < 0.0)):
            return int(bead), -1 - 2 * int(axis)
        for bead, axis in np.argwhere((x > self.box - radii) & (v > 0.0)):
            return int(bead), -2 - 2 * int(axis)
        return None

    def _owner(self, bead):
        return next(body for body in self.bodies if bead in body.beads)

    def _per_impulse(self, body, arm, normal):
        inertia = body.turn @ body.inertia @ body.turn.T
        turning = np.linalg.solve(inertia, np.cross(arm, normal))
        return 1.0 / body.mass + normal @ np.cross(turning, arm)

    def _collide(self, i, j):
        x, v = self.places_and_velocities()
        if j < 0:
            axis, far = divmod(-1 - j, 2)
            normal = np.eye(3)[axis] * (1.0 if far else -1.0)
            self.events.append((self.time, 'wall', i, -1 - j))
            body = self._owner(i)
            arm = x[i] - body.centre
            size = -(1.0 + self.walls) * (v[i] @ normal) / self._per_impulse(body, arm, normal)
            body.velocity = body.velocity + size * normal / body.mass
            body.moment = body.moment + np.cross(arm, size * normal)
            return
        normal = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i])
        closing = (v[j] - v[i]) @ normal
        a, b = self._owner(i), self._owner(j)
        if -closing < self.sticking:
            self.events.append((self.time, 'merge', i, j))
            self._merge(a, b, x)
            return
        self.events.append((self.time, 'pair', i, j))
        arms = x[i] - a.centre, x[j] - b.centre
        per = self._per_impulse(a, arms[0], normal) + self._per_impulse(b, arms[1], normal)
        impulse = -(1.0 + self.restitution) * closing / per * normal
        for body, arm, sign in ((a, arms[0], -1.0), (b, arms[1], 1.0)):
            body.velocity = body.velocity + sign * impulse / body.mass
            body.moment = body.moment + sign * np.cross(arm, impulse)

    def _merge(self, a, b, x):
        beads = a.beads + b.beads
        velocity = (a.mass * a.velocity + b.mass * b.velocity) / (a.mass + b.mass)
        joined = self._body(beads, x[beads], velocity, np.zeros(3))
        for body in (a, b):
            arm = body.centre - joined.centre
            joined.moment = joined.moment + body.moment + np.cross(arm, body.mass * body.velocity)
        self.bodies = [body for body in self.bodies if body is not a and body is not b]
        self.bodies.append(joined)
