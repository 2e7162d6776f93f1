"""Fit of the cluster curve, from autocorrelation width to cluster size, to simulated images.

Tested by ``test/inference/cluster_size/test_cluster_curve.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.cluster_size.size_from_width import ClusterCurve, Width

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Smallest level area and contrast of beads, as fractions of those of simulated single beads.
_SMALL, _FAINT = 0.6, 0.4
# Margin of ln(breadth) beyond the simulated range.
_OUTSIDE = 0.1
# Largest error of ln(size): a factor of three.
_WORST = math.log(3.0)
# Sizes above this fraction of the largest look alike: the weight is fitted without them.
_GROWING = 0.7
# Width of the bins of ln(size), and smallest number of images in a bin.
_BIN = 0.3
_FEWEST = 8
# Mean sizes below this are single beads with a few pairs.
_SINGLE = 1.05


def fit_curve(
    tray: str,
    level: float,
    samples: NDArray[np.float32],
    made_by: str = '{}',
    discs: float = 0.0,
) -> ClusterCurve:
    """Fit the curve to simulated images.

    Parameters
    ----------
    tray : str
        Its `curve_key`.
    level : float
    samples : ndarray (n_samples, 6)
        See `ClusterCurve`.
    made_by : str
        JSON.
    discs : float
        See `ClusterCurve`.
    """
    seen = samples[samples[:, 4] > 0.0].astype(np.float64)
    log_size, log_area = np.log(seen[:, 2]), np.log(seen[:, 3])
    log_breadth = np.log(seen[:, 3] / seen[:, 4])
    above = np.floor((log_size - math.log(_SINGLE)) / _BIN)
    bins = np.where(seen[:, 2] < _SINGLE, -1, above)
    groups = [bins == k for k in np.unique(bins) if (bins == k).sum() >= _FEWEST]
    nodes, means, spreads = np.empty((3, 0))
    end, weight, least, breadths = 0, 0.0, Width(0.0, 0.0, 0.0), (0.0, math.inf)
    # Without images of single beads the curve has no start.
    if groups and bins[groups[0]][0] < 0:
        weight = _weight(log_size, log_area, log_breadth)
        reading = log_breadth + weight * log_area
        nodes, means = _rising(
            np.array([log_size[group].mean() for group in groups]),
            np.array([reading[group].mean() for group in groups]),
            np.array([group.sum() for group in groups], dtype=np.float64),
        )
        nodes[0] = 0.0
        single = seen[groups[0]].min(axis=0)
        least = Width(_SMALL * float(single[3]), 0.0, _FAINT * float(single[5]))
        breadths = (
            math.exp(log_breadth.min() - _OUTSIDE),
            math.exp(log_breadth.max() + _OUTSIDE),
        )
        spreads = _scatter(log_size, reading, nodes, means)
        end = _useful(nodes, means, spreads)
        # Flat from the last node to the largest simulated size.
        nodes = np.append(nodes, log_size.max())
        means, spreads = np.append(means, means[-1]), np.append(spreads, spreads[-1])
    return ClusterCurve(
        tray=tray,
        made_by=made_by,
        level=level,
        log_size=nodes,
        reading=means,
        scatter=spreads,
        end=end,
        weight=weight,
        least=least,
        breadths=breadths,
        discs=discs,
        samples=samples,
    )


def _weight(
    log_size: NDArray[np.float64],
    log_area: NDArray[np.float64],
    log_breadth: NDArray[np.float64],
) -> float:
    """Weight of ln(area) beside ln(breadth), by Fisher's linear discriminant; not negative."""
    growing = log_size <= log_size.max() + math.log(_GROWING)
    terms = np.polynomial.polynomial.polyvander(log_size[growing], 3)
    seen = np.column_stack((log_area, log_breadth))[growing]
    factors = np.linalg.lstsq(terms, seen, rcond=None)[0]
    noise = np.cov((seen - terms @ factors).T)
    largest = log_size[growing].max()
    rise = (largest ** np.arange(1, 4)) @ factors[1:]
    by_area, by_breadth = np.linalg.lstsq(noise, rise, rcond=None)[0]
    return float(np.clip(by_area / by_breadth, 0.0, 1.0)) if by_breadth > 0.0 else 0.0


def _rising(
    places: NDArray[np.float64], values: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Isotonic regression: neighbours whose values do not rise are pooled."""
    blocks: list[NDArray[np.float64]] = []
    for block in np.column_stack((weights * places, weights * values, weights)):
        blocks.append(block)
        while len(blocks) > 1 and blocks[-2][1] / blocks[-2][2] >= blocks[-1][1] / blocks[-1][2]:
            last = blocks.pop()
            blocks[-1] = blocks[-1] + last
    sums = np.array(blocks)
    return sums[:, 0] / sums[:, 2], sums[:, 1] / sums[:, 2]


def _scatter(
    log_size: NDArray[np.float64],
    reading: NDArray[np.float64],
    nodes: NDArray[np.float64],
    means: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Standard deviation about the curve of the images nearest to each node."""
    squares = (reading - np.interp(log_size, nodes, means)) ** 2
    nearest = np.abs(log_size[:, None] - nodes).argmin(axis=1)
    # A node with few images may not be the nearest of any.
    return np.array(
        [
            math.sqrt(squares[nearest == k].mean() if (nearest == k).any() else squares.mean())
            for k in range(nodes.size)
        ]
    )


def _useful(
    nodes: NDArray[np.float64], means: NDArray[np.float64], spreads: NDArray[np.float64]
) -> int:
    """Number of nodes up to the last whose size is known to a factor of three.

    0 if that size is below three beads: then the width hardly depends on the size.
    """
    # The lower error: the curve exists there, and no size is below 1.
    errors = nodes - np.interp(means - spreads, means, nodes)
    good = np.flatnonzero((errors <= _WORST) & (means - means[0] > spreads))
    end = int(good[-1]) + 1 if good.size else 0
    return end if end and nodes[end - 1] >= _WORST else 0
