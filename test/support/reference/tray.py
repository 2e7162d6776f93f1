"""Walls of the reference engine: motion, and contact times with moving walls.

Walls are numbered x low, x high, y low, y high, z low, z high.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np


def axis_of(wall):
    return wall // 2


def inward_of(wall):
    """+1 for a low wall, -1 for a high one: the direction of the axis that points inside."""
    return 1.0 if wall % 2 == 0 else -1.0


def bisected(function, a, b):
    """The two neighbouring numbers of [a, b] between which the function changes sign."""
    positive = function(a) > 0.0
    while True:
        middle = 0.5 * (a + b)
        if not a < middle < b:
            return a, b
        if (function(middle) > 0.0) == positive:
            a = middle
        else:
            b = middle


class Tray:
    """The walls, shaken together when `motion` is given; a periodic axis has none."""

    def __init__(self, box, periodic, motion):
        self.box = [float(side) for side in box]
        self.walls = [wall for wall in range(6) if not periodic[axis_of(wall)]]
        self.periods = [
            side if repeats else None for side, repeats in zip(self.box, periodic, strict=True)
        ]
        self.motion = motion

    def shaken(self, time):
        return self.motion is not None and self.motion.start <= time <= self.motion.end

    def displacement(self, time):
        if not self.shaken(time):
            return np.zeros(3)
        m, since = self.motion, time - self.motion.start
        decay = math.exp(-m.damping * since)
        return np.array(m.amplitude) * decay * math.sin(m.angular_frequency * since)

    def velocity(self, time):
        if not self.shaken(time):
            return np.zeros(3)
        m, since = self.motion, time - self.motion.start
        phase = m.angular_frequency * since
        rate = m.angular_frequency * math.cos(phase) - m.damping * math.sin(phase)
        return np.array(m.amplitude) * math.exp(-m.damping * since) * rate

    def coordinate(self, wall, time):
        axis = axis_of(wall)
        side = 0.0 if wall % 2 == 0 else self.box[axis]
        return side + self.displacement(time)[axis]

    def least_rebound(self, wall, time, contact_duration):
        """Least speed with which a bead leaves a wall: what the wall reaches in half t_c."""
        if not self.shaken(time):
            return 0.0
        m, since = self.motion, time - self.motion.start
        acceleration = abs(m.amplitude[axis_of(wall)]) * (m.angular_frequency + m.damping) ** 2
        return acceleration * math.exp(-m.damping * since) * contact_duration / 2.0

    def phases(self, first, last):
        """The times [first, last] cut where the motion starts and stops: (from, to, shaken)."""
        if self.motion is None:
            return [(first, last, False)]
        start, end = self.motion.start, self.motion.end
        cuts = [
            (first, min(last, np.nextafter(start, -math.inf)), False),
            (max(first, start), min(last, end), True),
            (max(first, np.nextafter(end, math.inf)), last, False),
        ]
        return [cut for cut in cuts if cut[0] <= cut[1]]

    def inflections(self, first, last):
        """Times within (first, last) when the acceleration of the shaken tray is zero.

        The second derivative of exp(-d t) sin(w t) is
        exp(-d t) ((d² - w²) sin(w t) - 2 d w cos(w t)).
        """
        w, d = self.motion.angular_frequency, self.motion.damping
        angle = math.atan2(2.0 * d * w, d**2 - w**2)
        low = math.floor((w * (first - self.motion.start) - angle) / math.pi)
        high = math.ceil((w * (last - self.motion.start) - angle) / math.pi)
        times = [self.motion.start + (angle + k * math.pi) / w for k in range(low, high + 1)]
        return [time for time in times if first < time < last]


class Approach:
    """One bead and one wall of a shaken tray, the bead flying on straight from `now`."""

    def __init__(self, tray, wall, bead, now):
        """Take the bead as (coordinate, velocity) along the axis of the wall, and its radius."""
        self.tray, self.wall, self.now = tray, wall, now
        self.coordinate, self.speed, self.radius = bead

    def clearance(self, time):
        place = self.coordinate + self.speed * (time - self.now)
        return inward_of(self.wall) * (place - self.tray.coordinate(self.wall, time)) - self.radius

    def opening(self, time):
        """How fast the clearance grows."""
        wall_speed = self.tray.velocity(time)[axis_of(self.wall)]
        return inward_of(self.wall) * (self.speed - wall_speed)

    def meeting(self, first, last):
        """First time in [first, last] at which bead and wall touch and approach; inf if none."""
        for a, b, shaken in self.tray.phases(first, last):
            time = self._meeting_shaken(a, b) if shaken else self._meeting_at_rest(a, b)
            if time < math.inf:
                return time
        return math.inf

    def _meeting_at_rest(self, first, last):
        opening = self.opening(first)
        if opening >= 0.0:
            return math.inf
        time = first + max(self.clearance(first), 0.0) / -opening
        return time if time <= last else math.inf

    def _meeting_shaken(self, first, last):
        """Between inflections `opening` is monotonic; between its zeros `clearance` is."""
        knots = [first, *self.tray.inflections(first, last), last]
        for a, b in pairwise(knots):
            for start, stop in self._one_way(a, b):
                time = self._meeting_while_closing(start, stop)
                if time < math.inf:
                    return time
        return math.inf

    def _one_way(self, a, b):
        """Cut [a, b] where the clearance turns round."""
        if self.clearance_at_least(a, b) > 0.0:
            return []
        if (self.opening(a) > 0.0) == (self.opening(b) > 0.0):
            return [(a, b)]
        before, after = bisected(self.opening, a, b)
        return [(a, before), (after, b)]

    def clearance_at_least(self, a, b):
        """What is left of the clearance in [a, b] if the wall comes as near as it ever can."""
        axis = axis_of(self.wall)
        side = 0.0 if self.wall % 2 == 0 else self.tray.box[axis]
        places = [self.coordinate + self.speed * (time - self.now) for time in (a, b)]
        free = min(inward_of(self.wall) * (place - side) for place in places) - self.radius
        return free - abs(self.tray.motion.amplitude[axis]) * (1.0 + 1e-12)

    def _meeting_while_closing(self, a, b):
        """Meeting in [a, b], where the clearance only grows or only shrinks."""
        if self.opening(0.5 * (a + b)) >= 0.0:
            return math.inf
        if self.clearance(a) <= 0.0:
            return a
        if self.clearance(b) > 0.0:
            return math.inf
        return bisected(self.clearance, a, b)[1]
