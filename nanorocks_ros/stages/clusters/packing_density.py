"""Packing density of the clusters of a tray at one instant, from the positions of the beads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.filling_factor import (
    filling_of_height,
    hull_area,
    layer_filling,
    paper_cluster_filling,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Packing:
    """Packing of all clusters of a tray: ratios of sums over the clusters.

    Parameters
    ----------
    clusters : int
        Bodies of two and more beads.
    beads : float
        Mean number in a cluster.
    area : float, [m^2]
        Mean area of the hull of a cluster in the picture.
    filling, filling_error : float
        Of a layer one bead high; its error is the scatter of clusters (jackknife), NaN for one.
        Beads that lie over each other are not taken into account: see `least`.
    least : float
        The same if clusters were as high as the tray.
    paper : float
        By the paper's formula, for the mean bead, number and area.
    """

    clusters: int
    beads: float
    area: float
    filling: float
    filling_error: float
    least: float
    paper: float


def packing_of_clusters(
    places: NDArray[np.float64],
    radii: NDArray[np.float64],
    bodies: NDArray[np.int32],
    height: float,
) -> Packing | None:
    """Packing density of the clusters; None where no beads stick together.

    Parameters
    ----------
    places : ndarray (n, 2), [m]
        In the picture.
    radii : ndarray (n,), [m]
    bodies : ndarray of int, (n,)
        Beads with the same number are one body, see `bodies_of_pairs`.
    height : float, [m]
        Of the tray.

    Raises
    ------
    ConfigurationError
        For other shapes, or a number that is not finite.
    """
    places, radii = np.asarray(places, dtype=np.float64), np.asarray(radii, dtype=np.float64)
    bodies = np.asarray(bodies)
    if not (places.shape == (radii.size, 2) and bodies.shape == radii.shape == (radii.size,)):
        raise ConfigurationError(
            'places, radii, bodies',
            f'shapes {places.shape}, {radii.shape}, {bodies.shape}',
            'give a place, a radius and a body for each bead',
        )
    labels, counts = np.unique(bodies, return_counts=True)
    members = [np.flatnonzero(bodies == label) for label in labels[counts > 1]]
    if not members:
        return None
    areas = np.array([hull_area(places[member], radii[member]) for member in members])
    covered = np.array([np.sum(radii[member] ** 2) for member in members])
    own = radii[np.concatenate(members)]
    beads, area = own.size / len(members), float(areas.mean())
    return Packing(
        clusters=len(members),
        beads=beads,
        area=area,
        filling=layer_filling(own, float(areas.sum())),
        filling_error=_jackknife(covered, areas) * layer_filling(np.ones(1), 1.0),
        least=filling_of_height(own, float(areas.sum()), height),
        paper=paper_cluster_filling(
            beads, 4.0 / 3.0 * math.pi * float(np.mean(own**3)), area, float(own.mean())
        ),
    )


def bodies_of_pairs(
    ids: NDArray[np.int32], pairs: NDArray[np.int32] | list[tuple[int, int]]
) -> NDArray[np.int32]:
    """Label each bead by the smallest number of a bead in its body.

    Parameters
    ----------
    ids : ndarray of int, (n,)
        Numbers of the beads that are seen, such as `Tracks.ids`.
    pairs : (m, 2)
        Numbers of beads that stick together; those not among `ids` may join others.
    """
    root: dict[int, int] = {int(bead): int(bead) for bead in ids}

    def find(bead: int) -> int:
        while root.setdefault(bead, bead) != bead:
            root[bead] = root[root[bead]]
            bead = root[bead]
        return bead

    for first, second in pairs:
        low, high = sorted((find(int(first)), find(int(second))))
        root[high] = low
    return np.array([find(int(bead)) for bead in ids], dtype=np.int32)


def _jackknife(above: NDArray[np.float64], below: NDArray[np.float64]) -> float:
    """Standard error of sum(above) / sum(below) over independent members."""
    n = above.size
    if n < 2:
        return math.nan
    without = (above.sum() - above) / (below.sum() - below)
    return math.sqrt((n - 1) / n * float(np.sum((without - without.mean()) ** 2)))
