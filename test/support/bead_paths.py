"""Tracks of beads with known trajectories."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.records import Tracks

RATE = 30.0
PIXEL = 1.0 / 12500.0


def tracks_of(positions, *, velocities=None, displacements=None, jitter=0.0, seed=1, tray=1):
    """One record of beads of 2 mm for each frame.

    `positions` (frames, n, 2) are in the camera frame; `jitter` is the noise in metres. The stated
    error is at least a twentieth of a pixel.
    """
    positions = np.asarray(positions, dtype=float)
    frames, n = positions.shape[:2]
    shifts = np.zeros((frames, 2)) if displacements is None else np.asarray(displacements)
    rng = np.random.default_rng(seed)
    for k in range(frames):
        yield Tracks(
            stamp_ns=round(k / RATE * 1e9),
            tray=tray,
            ids=np.arange(n, dtype=np.int32),
            species=np.zeros(n, dtype=np.int32),
            displacement=shifts[k],
            positions=positions[k] - shifts[k] + rng.normal(0.0, jitter, (n, 2)),
            position_errors=np.full(n, max(jitter, 0.05 * PIXEL)),
            velocities=np.full((n, 2), np.nan) if velocities is None else velocities[k],
            velocity_errors=np.full(n, np.nan),
            radii=np.full(n, 1e-3),
            radius_errors=np.full(n, 1e-6),
            seen=np.ones(n, dtype=bool),
            expected=np.array([n], dtype=np.int32),
        )


def bounced(time, speed, restitution, *, at=0.4, along=0.0, wall=lambda t: 0.0, change=0.0):
    """Positions of a bead of 2 mm that rebounds from wall 0 at time `at`, (frames, 1, 2).

    Its speed is `speed` towards the wall and `along` parallel to it; `change` is added to the
    second at the rebound. `wall` gives the position of the wall at a time.
    """
    step = 1e-5
    wall_velocity = (wall(at + step) - wall(at - step)) / (2.0 * step)
    contact = 1e-3 + wall(at)
    outgoing = wall_velocity + restitution * (speed + wall_velocity)
    x = np.where(time < at, contact - speed * (time - at), contact + outgoing * (time - at))
    y = 7e-3 + along * (time - at) + np.where(time > at, change * (time - at), 0.0)
    return np.stack([x, y], axis=1)[:, None]
