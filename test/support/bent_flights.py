"""Free flights of beads in a gas, with a common acceleration."""

from __future__ import annotations

import math

import numpy as np

from nanorocks_ros.records import FreeFlight


def bent_flights(
    number,
    drag,
    acceleration=(0.0, 0.0),
    *,
    seed=1,
    kinks=0.0,
    friction_rate=0.0,
    first_ns=0,
    species=0,
    relative_drag=1.0,
):
    """Flights with Gaussian errors, some as large again by unseen hits.

    `drag` is that of the species itself. `kinks` is the share of flights whose bend is wrong by
    fifty errors and slows the bead.
    """
    rng = np.random.default_rng(seed)
    for k in range(number):
        # The gas cools.
        temperature = 2e-5 / (1.0 + 10.0 * k / number) ** 2
        velocity = rng.normal(0.0, math.sqrt(temperature), 2)
        error = float(rng.choice([1e-5, 3e-5, 1e-4]))
        bend = np.asarray(acceleration) - drag * velocity
        bend -= friction_rate * temperature * velocity / np.hypot(*velocity)
        bend += rng.normal(0.0, error, 2)
        if rng.random() < kinks:
            bend -= 50.0 * error * velocity / np.hypot(*velocity)
        yield FreeFlight(
            stamp_ns=first_ns + k * 10**7,
            tray=1,
            cycle=1,
            track=k,
            species=species,
            duration=1.0,
            points=30,
            mean_velocity=velocity,
            mean_acceleration=bend,
            acceleration_error=error,
            relative_drag=relative_drag,
            reduced_chi_square=float(rng.chisquare(54) / 54.0),
            temperature=temperature,
        )
