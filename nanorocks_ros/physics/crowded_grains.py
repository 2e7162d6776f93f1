"""Grains that hide one another in a picture, and how far they come between two collisions.

Grains that cover the floor several times over lie in the picture like discs thrown at random, and
each pixel shows the topmost. When every grain moves by itself, a pixel stays the same only while
no grain enters or leaves it at any height; the autocovariance of the picture, in which all move
together, has to be converted. In a Boolean model of opaque discs with n layers in the mean, of
which two pictures share r each, that covariance is (exp(n r) - 1) / (exp(n) - 1).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.kinetic_theory import contact_value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Self-diffusion of hard spheres over n d^2 chi, times the mean speed and without the temperature:
# 3 / (8 sqrt(pi)) * sqrt(8 / pi); Chapman, Cowling 1970, chapters 10 and 16.
_DIFFUSION = 3.0 * math.sqrt(8.0) / (8.0 * math.pi)
# Mean speed in the image plane over that in space, of an isotropic gas.
_PROJECTED = 0.25 * math.pi
# Paths at which their displacement is tabulated, in persistence lengths.
_PATHS = np.concatenate([np.linspace(0.0, 5.0, 1001), np.geomspace(5.1, 1e4, 400)])
_REACHED = np.sqrt(2.0 * (_PATHS + np.expm1(-_PATHS)))


def layers_of(tray: Tray) -> float:
    """Number of grains above one another over a point of the floor, in the mean."""
    area = sum(
        0.25
        * math.pi
        * species.count
        * _mean_power(species.diameter_low, species.diameter_high, 2)
        for species in tray.species
    )
    return area / (tray.dimensions[0] * tray.dimensions[1])


def persistence_length(tray: Tray) -> float:
    """Path in the image plane over which a grain of a dense gas keeps its velocity, [m].

    The time is that of Enskog's self-diffusion, m D / kT, in the volume open to the centres of the
    grains. The gas is taken to be elastic and of one size: simulated trays 6 and 8 lost 0.71 and
    1.13 of a displacement per diameter of it, this gives 0.73 and 1.11.
    """
    count = tray.count
    diameter = sum(species.count * species.diameter for species in tray.species) / count
    volume = math.prod(side - diameter for side in tray.dimensions)
    grains = sum(
        math.pi / 6.0 * species.count * _mean_power(species.diameter_low, species.diameter_high, 3)
        for species in tray.species
    )
    crowding = contact_value(grains / math.prod(tray.dimensions))
    return _PROJECTED * _DIFFUSION * volume / (count * diameter**2 * crowding)


def _mean_power(low: float, high: float, power: int) -> float:
    """Mean of a power of a number that is spread evenly over a range."""
    if low == high:
        return low**power
    return (high ** (power + 1) - low ** (power + 1)) / ((power + 1) * (high - low))


def shared_outline(correlation: NDArray[np.float64], layers: float) -> NDArray[np.float64]:
    """Share of its area that each grain keeps, by the correlation of two pictures.

    Parameters
    ----------
    correlation : ndarray, 0 to 1
    layers : float, > 0
        Of :func:`layers_of`.
    """
    return np.asarray(np.log1p(correlation * math.expm1(layers)) / layers)


def picture_correlation(shared: NDArray[np.float64], layers: float) -> NDArray[np.float64]:
    """The inverse of :func:`shared_outline`, for the mean share of grains that move singly."""
    return np.asarray(np.expm1(layers * shared) / math.expm1(layers))


def path_of_displacement(
    displacement: NDArray[np.float64] | float, persistence: float
) -> NDArray[np.float64]:
    """Path of grains whose velocities die away exponentially along it, by their displacement.

    Parameters
    ----------
    displacement : ndarray or float, any length
    persistence : float, the same length

    Returns
    -------
    ndarray
        The displacement is sqrt(2 (x - 1 + exp(-x))) persistence lengths for a path of x.
    """
    return np.asarray(persistence * np.interp(displacement / persistence, _REACHED, _PATHS))


def displacement_of_path(path: float, persistence: float) -> float:
    """The inverse of :func:`path_of_displacement`."""
    return float(persistence * np.interp(path / persistence, _PATHS, _REACHED))
