"""Stokes' law: the drag of a gas on a sphere that moves and turns slowly in it.

References
----------
Stokes 1851, Trans. Cambridge Phil. Soc. 9, 8: force 6 pi eta r v. Lamb 1932, Hydrodynamics, 6th
ed., sections 334 and 337: torque 8 pi eta r^3 omega.
"""

from __future__ import annotations

from nanorocks_ros.numerics.compiled import compiled

# Decay rate of the angular velocity of a solid sphere over that of its velocity: the torque over
# the moment of inertia 2/5 m r^2, over the force over the mass.
TURNING_PER_MOVING = (8.0 / (2.0 / 5.0)) / 6.0


@compiled
def stokes_rate(viscosity: float, density: float, diameter: float) -> float:
    """Rate at which the velocity of a sphere decays, [1/s].

    Parameters
    ----------
    viscosity : float, [Pa s]
        Of the gas. It does not depend on the pressure while the mean free path of the molecules
        is small beside the sphere; in thinner gas the drag is smaller.
    density : float, [kg/m^3]
        Of the sphere.
    diameter : float, [m]
    """
    return 18.0 * viscosity / (density * diameter * diameter)


def viscosity_of(rate: float, density: float, diameter: float) -> float:
    """Viscosity at which a sphere has a decay rate, [Pa s]: `stokes_rate` the other way.

    In a thin gas it is the viscosity that would drag as much.
    """
    return rate * density * diameter * diameter / 18.0
