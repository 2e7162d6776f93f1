"""Restitution and impulses of the reference engine."""

from __future__ import annotations

import math

import numpy as np

from nanorocks_ros.numerics.counter_rng import Purpose, hashed, key_for, uniform


def pair_restitution(rules, species, beads, counts, approach):
    """Coefficient of restitution of beads (i, j), i < j, whose velocities changed `counts` times.

    Parameters
    ----------
    approach : normal approach speed, [m/s]
    """
    restitution = rules.restitution
    if hasattr(restitution, 'at_speed'):
        return viscoelastic(restitution.value, restitution.at_speed, approach)
    if hasattr(restitution, 'width'):
        u = collision_uniform(rules.seed, *beads, *counts)
        return restitution.mean + restitution.width * (u - 0.5)
    if np.ndim(restitution) == 2:
        return restitution[species[0]][species[1]]
    return float(restitution)


def collision_uniform(seed, i, j, count_i, count_j):
    """Random number in [0, 1) of one collision of beads i < j."""
    key = key_for(seed, 0, Purpose.RESTITUTION)
    for number in (i, j, count_i):
        key = np.uint64(hashed(np.uint64(key), int(number)))
    return uniform(key, int(count_j))


def viscoelastic(value, at_speed, approach):
    """Restitution at a speed of spheres that have a known one at another speed.

    References
    ----------
    Mueller & Poeschel 2011, Phys. Rev. E 84, 021302: the Padé approximant.
    """
    return viscoelastic_pade(pade_argument(value) * (approach / at_speed) ** 0.1)


def viscoelastic_pade(z):
    over = 1.0 + 0.501086 * z
    under = 1.0 + 0.501086 * z + 1.15345 * z**2 + 0.577977 * z**3 + 0.532178 * z**4
    return over / under


def pade_argument(value):
    """Argument at which the approximant, which falls all the way, has the value."""
    low, high = 0.0, 1.0
    while viscoelastic_pade(high) > value:
        high *= 2.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if viscoelastic_pade(middle) > value else (low, middle)
    return high


def slip(normal, u, turning):
    """Tangential relative velocity of the surfaces.

    Parameters
    ----------
    normal : unit vector from i to j
    u : velocity of j less that of i
    turning : r_i w_i + r_j w_j
    """
    surfaces = u - np.cross(turning, normal)
    return surfaces - (u @ normal) * normal


def normal_impulse(normal, u, per_masses, restitution):
    """Impulse on j along the normal."""
    return -(1.0 + restitution) * (u @ normal) * normal / sum(per_masses)


def tangential_impulse(slipping, per_masses, radii, per_inertias, tangential, limit=math.inf):
    """Impulse on j across the normal, `most` at most; a per_inertia is 0 for what cannot turn."""
    per_mass = sum(per_masses) + sum(
        radius**2 * per_inertia for radius, per_inertia in zip(radii, per_inertias, strict=True)
    )
    gripping = -(1.0 + tangential) * slipping / per_mass
    size = math.sqrt(gripping @ gripping)
    return gripping if size <= limit else gripping * (limit / size)
