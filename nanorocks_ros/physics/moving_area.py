"""Area that a moving disc uncovers and covers, for the speed from binarised images.

Tested by ``test/physics/test_paper_formulas.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Quadrature of the Rayleigh distribution: quantiles at the centres of equal probabilities.
_PROBABILITIES = (np.arange(256) + 0.5) / 256
_RAYLEIGH_NODES = np.sqrt(-4.0 / np.pi * np.log1p(-_PROBABILITIES))
RAYLEIGH_NODES = _RAYLEIGH_NODES / _RAYLEIGH_NODES.mean()
"""Displacements of equal probability of a Rayleigh distribution of mean 1."""


def moving_area(displacement: NDArray[np.float64] | float, radius: float) -> NDArray[np.float64]:
    """Symmetric difference of a disc and the same disc displaced.

    Parameters
    ----------
    displacement : ndarray or float, [m]
    radius : float, [m]

    Returns
    -------
    ndarray, [m^2]
        2 pi R^2 from a displacement of one diameter on: the discs no longer overlap.

    References
    ----------
    [B19] eq. 1, with 1 - h/R = dx / 2R.
    """
    u = np.clip(np.abs(np.asarray(displacement, dtype=np.float64)) / (2.0 * radius), 0.0, 1.0)
    # The printed form loses precision at small u; this form is equivalent.
    return np.asarray(4.0 * radius**2 * (np.arcsin(u) + u * np.sqrt(1.0 - u * u)))


def mean_moving_area(
    mean_displacement: NDArray[np.float64] | float, radius: float
) -> NDArray[np.float64]:
    """The exact area averaged over Rayleigh-distributed displacements of the given mean.

    The projected velocity of a gas in equilibrium is Gaussian in each direction, so its
    modulus, and with it the displacement between two frames, follows Rayleigh's law.
    """
    mean = np.asarray(mean_displacement, dtype=np.float64)
    areas = moving_area(mean[..., np.newaxis] * RAYLEIGH_NODES, radius)
    return np.asarray(areas.mean(axis=-1))


def mean_displacement(area: float, radius: float, geometry: str) -> float:
    """Mean displacement of discs whose mean moving area was measured.

    Parameters
    ----------
    area : float, [m^2]
        Moving area per disc.
    radius : float, [m]
    geometry : {'exact', 'taylor'}
        The exact area over Rayleigh-distributed displacements, or the paper's Taylor form.

    Returns
    -------
    float, [m]
        NaN when the exact area is at its limit 2 pi R^2.
    """
    if geometry == 'taylor':
        return area / (4.0 * radius)
    grid = np.linspace(0.0, 6.0 * radius, 601)
    areas = mean_moving_area(grid, radius)
    if area >= areas[-1]:
        return float('nan')
    return float(np.interp(area, areas, grid))
