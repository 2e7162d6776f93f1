"""A slow and obvious event-driven engine: every step, ask all, take the first, move all."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class Bead:
    position: list[float]
    velocity: list[float]
    radius: float
    mass: float


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def contact_time(one, other):
    apart = minus(other.position, one.position)
    relative = minus(other.velocity, one.velocity)
    b = dot(apart, relative)
    if b >= 0.0:
        return math.inf
    a = dot(relative, relative)
    c = dot(apart, apart) - (one.radius + other.radius) ** 2
    if c <= 0.0:
        return 0.0
    discriminant = b * b - a * c
    return (-b - math.sqrt(discriminant)) / a if discriminant >= 0.0 else math.inf


def wall_time(bead, axis, side):
    speed = bead.velocity[axis]
    if speed == 0.0:
        return math.inf
    target = side - bead.radius if speed > 0.0 else bead.radius
    return max((target - bead.position[axis]) / speed, 0.0)


def next_event(beads, box):
    """Waiting time, kind and partners of the first event."""
    candidates = [
        (contact_time(beads[i], beads[j]), 'pair', i, j)
        for i in range(len(beads))
        for j in range(i + 1, len(beads))
    ]
    candidates += [
        (wall_time(bead, axis, box[axis]), 'wall', i, axis)
        for i, bead in enumerate(beads)
        for axis in range(3)
    ]
    return min(candidates)


def collide(one, other, restitution):
    apart = minus(other.position, one.position)
    distance = math.sqrt(dot(apart, apart))
    normal = [x / distance for x in apart]
    closing = dot(minus(other.velocity, one.velocity), normal)
    reduced = one.mass * other.mass / (one.mass + other.mass)
    impulse = (1.0 + restitution) * reduced * closing
    one.velocity = [v + impulse / one.mass * n for v, n in zip(one.velocity, normal, strict=True)]
    other.velocity = [
        v - impulse / other.mass * n for v, n in zip(other.velocity, normal, strict=True)
    ]


def follow(beads, box, restitution, wall_restitution, events):
    """Yield (time, kind) of each event, after it has happened to the beads."""
    time = 0.0
    for _ in range(events):
        wait, kind, i, partner = next_event(beads, box)
        time += wait
        for bead in beads:
            bead.position = [
                x + v * wait for x, v in zip(bead.position, bead.velocity, strict=True)
            ]
        if kind == 'pair':
            collide(beads[i], beads[partner], restitution)
        else:
            beads[i].velocity[partner] *= -wall_restitution
        yield time, kind
