"""Filling factors of clusters: that of the paper, and that of a layer of beads.

The camera sees an area A; a volume needs a height. The paper uses one radius, A r, but a layer of
beads is one diameter high, A 2r: its filling factors are twice those of the layer. A layer of
equal beads fills at most pi / (3 sqrt 3) = 0.605 of its volume (hexagonal order). That is close
to the 0.64 of random close packing in three dimensions, but unrelated.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.kinetic_theory import check_positive

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Largest covered fraction of an area by equal discs, in hexagonal order; Thue 1892.
HEXAGONAL_AREA = math.pi / math.sqrt(12.0)
# Volume ratio of a sphere to the cylinder around it.
SPHERE_IN_CYLINDER = 2.0 / 3.0
# Filling factor of a flat layer of equal beads in hexagonal order.
HEXAGONAL_LAYER = SPHERE_IN_CYLINDER * HEXAGONAL_AREA
# Filling factor of equal beads in three dimensions, for comparison in [B19] section 3.2.3.
RANDOM_CLOSE_PACKING = 0.64
# (ff_end - ff_onset) / ff_onset by tray, [B19] section 3.2.3 and fig. 10; the filling factors
# themselves are in its figure alone.
PAPER_COMPACTION = {1: 0.066, 3: 0.029, 5: 0.027}
# Particles per cluster by tray, counted by hand at the end of 18 cycles: [B19] table 3.
PAPER_CLUSTER_SIZES = {1: 2.85, 3: 5.52, 5: 6.55}
# Number of directions of the tangents of a hull; the area of a disc is too small by 1e-5.
_DIRECTIONS = 720


def paper_cluster_filling(
    beads: float, bead_volume: float, area: float, bead_radius: float
) -> float:
    """Filling factor of a cluster in the paper, with a cluster volume of A r.

    Parameters
    ----------
    beads : float
        Number in the cluster; the mean over clusters for a mean area.
    bead_volume : float, [m^3]
    area : float, [m^2]
        Of the cluster in the picture.
    bead_radius : float, [m]

    Returns
    -------
    float
        Twice the filling factor of a layer: up to 1.21 for equal beads in hexagonal order.

    Raises
    ------
    ConfigurationError
        When a value is not positive and finite.

    References
    ----------
    [B19] section 3.2.3: ff = V_part / V_clus, V_clus = A r ("d height, d being the particle
    radius").
    """
    check_positive(beads=beads, bead_volume=bead_volume, area=area, bead_radius=bead_radius)
    return beads * bead_volume / (area * bead_radius)


def layer_filling(radii: NDArray[np.float64], area: float) -> float:
    """Filling factor of a cluster of beads in one layer, with a cluster volume of A d.

    For beads of several sizes d is sum(d^3) / sum(d^2): then a layer whose beads cover the
    fraction c of the area fills 2/3 c of the volume, as for equal beads.

    Parameters
    ----------
    radii : ndarray (n,), [m]
        Of the beads of the cluster.
    area : float, [m^2]
        Of the cluster in the picture.

    Returns
    -------
    float
        Above 2/3 only if beads lie over each other, not in a single layer.

    Raises
    ------
    ConfigurationError
        For no bead, or a value that is not positive and finite.
    """
    check_positive(area=area)
    return SPHERE_IN_CYLINDER * math.pi * float(np.sum(_radii(radii) ** 2)) / area


def filling_of_height(radii: NDArray[np.float64], area: float, height: float) -> float:
    """Filling factor of a cluster of known height, V / (A h).

    With the height of the tray it is a lower bound.

    Parameters
    ----------
    radii : ndarray (n,), [m]
    area : float, [m^2]
    height : float, [m]

    Raises
    ------
    ConfigurationError
        For no bead, or a value that is not positive and finite.
    """
    check_positive(area=area, height=height)
    return 4.0 / 3.0 * math.pi * float(np.sum(_radii(radii) ** 3)) / (area * height)


def hull_area(places: NDArray[np.float64], radii: NDArray[np.float64]) -> float:
    """Area of the convex hull of discs, gaps between arms of a cluster included.

    This outline has no free parameter, is defined for any cluster, and shrinks when arms fold. A
    tighter outline does not: if gaps too small for a bead are filled, a straight chain covers as
    much of its area, 0.907, as hexagonal order.

    Parameters
    ----------
    places : ndarray (n, 2), [m]
    radii : ndarray (n,), [m]

    Returns
    -------
    float, [m^2]
        Relative error 1e-5.

    Raises
    ------
    ConfigurationError
        For no disc, other shapes, or a value that is not finite.
    """
    discs = _radii(radii)
    centres = np.asarray(places, dtype=np.float64)
    if centres.shape != (discs.size, 2) or not np.isfinite(centres).all():
        raise ConfigurationError(
            'places', f'shape {centres.shape}', f'give {discs.size} finite pairs, one for a disc'
        )
    angles = np.linspace(0.0, 2.0 * math.pi, _DIRECTIONS, endpoint=False)
    directions = np.column_stack((np.cos(angles), np.sin(angles)))
    # In each direction the outermost disc touches the hull.
    furthest = np.argmax(directions @ centres.T + discs, axis=1)
    x, y = (centres[furthest] + discs[furthest, np.newaxis] * directions).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _radii(radii: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.atleast_1d(np.asarray(radii, dtype=np.float64))
    if values.ndim != 1 or values.size == 0:
        raise ConfigurationError('radii', f'shape {values.shape}', 'give one for each bead')
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise ConfigurationError('radii', f'{values.min()!r}', 'give positive numbers')
    return values
