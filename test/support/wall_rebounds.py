"""Rebounds of beads from a side wall, with errors of their speeds."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.records import NS, Measured, Rebound


def wall_rebounds(rng, n, first, last, wall=0.97, error=1e-4):
    """Rebounds of tray 1 at drawn times, [s], with incoming speeds of 1 to 4 mm/s.

    `wall`: restitution of the wall, or its law of the speed; `error` of each speed, [m/s].
    """
    for time in np.sort(rng.uniform(first, last, n)):
        incoming = rng.uniform(1e-3, 4e-3)
        noise = rng.normal(0.0, error, 2)
        restitution = wall(incoming) if callable(wall) else wall
        yield Rebound(
            stamp_ns=round(time * NS),
            tray=1,
            track=0,
            species=0,
            wall=0,
            incoming=Measured(incoming + noise[0], error),
            outgoing=Measured(restitution * incoming + noise[1], error),
            tangential_incoming=0.0,
            tangential_outgoing=0.0,
            tangential_error=error,
            wall_velocity=Measured(0.0, 0.0),
            place=np.zeros(2),
        )
