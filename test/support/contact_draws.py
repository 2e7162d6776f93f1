"""Contacts drawn from the likelihoods."""

from __future__ import annotations

import math

import numpy as np

from nanorocks_ros.records import Measured, PairCollision, Rebound

RADIUS, HEIGHT = 1e-3, 3e-3


def drawn_rebound(incoming, outgoing, error, wall_error=0.0):
    return Rebound(
        stamp_ns=0,
        tray=1,
        track=0,
        species=0,
        wall=0,
        incoming=Measured(incoming, error),
        outgoing=Measured(outgoing, error),
        tangential_incoming=0.0,
        tangential_outgoing=0.0,
        tangential_error=error,
        wall_velocity=Measured(0.0, wall_error),
        place=np.zeros(2),
    )


def drawn_rebounds(rng, n, restitution, relative_error=0.05):
    for speed in rng.uniform(1e-3, 6e-3, n):
        error = relative_error * 3e-3
        noise = rng.normal(0.0, error, 2)
        yield drawn_rebound(speed + noise[0], restitution * speed + noise[1], error)


def drawn_collision(rng, restitution, **values):
    """A collision as it comes about between two beads in a flat gas; drawn until one does."""
    return drawn_impact(rng, lambda _: restitution, **values)[0]


def drawn_impact(
    rng, law, *, ratio=0.5, radius_error=0.0, sticking_speed=0.0, slowest=0.3e-3, spread=1e-3
):
    """A collision by a law of the impact speed, and that speed, [m/s].

    `slowest`: projected relative speed from which on it is found; `spread`: root of the
    temperature.
    """
    reach = 2.0 * RADIUS
    while True:
        tilt = rng.uniform(-1.0, 1.0)
        velocity = rng.normal(0.0, math.sqrt(2.0) * spread, 3) * (1.0, 1.0, math.sqrt(ratio))
        room = HEIGHT - 2.0 * RADIUS - abs(tilt) * reach
        part = math.sqrt(1.0 - tilt**2)
        normal = np.array([part, 0.0, tilt])
        speed = -float(velocity @ normal)
        # As often as they meet, and as their heights allow.
        accepted = rng.uniform() * 8.0 * spread < speed and rng.uniform() * RADIUS < room
        slow = speed < sticking_speed or -velocity[0] < slowest
        if accepted and not slow and part > 0.9:
            break
    after = velocity + (1.0 + law(speed)) * speed * normal
    error, place_error = 3e-5, 4e-6
    noise = rng.normal(0.0, error, (2, 2, 2))
    mean = rng.normal(0.0, spread, 2)
    halves = np.array([[-0.5], [0.5]])
    collision = PairCollision(
        stamp_ns=0,
        tray=1,
        tracks=np.array([0, 1], dtype=np.int32),
        species=np.zeros(2, dtype=np.int32),
        radii=np.full(2, RADIUS * (1.0 + radius_error)),
        radius_errors=np.full(2, 0.01 * RADIUS if radius_error else 0.0),
        masses=np.full(2, 5e-6),
        before=mean + halves * velocity[:2] + noise[0],
        after=mean + halves * after[:2] + noise[1],
        before_errors=np.full(2, error),
        after_errors=np.full(2, error),
        separation=np.array([part * reach, 0.0]) + rng.normal(0.0, place_error, 2),
        separation_error=place_error,
        temperatures=np.full(2, spread**2),
        height=HEIGHT,
        place=np.zeros(2),
    )
    return collision, speed


def drawn_collisions(seed, n, restitution, **values):
    rng = np.random.default_rng(seed)
    return [drawn_collision(rng, restitution, **values) for _ in range(n)]
