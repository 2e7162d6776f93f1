"""Numbers and sizes of bodies, from the bonds between beads."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import UNKNOWN_MEASURED, Measured

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.bodies.bonds import Bond

# Upper limits of the size classes; larger bodies are the last class.
_SIZE_CLASSES = (1, 2, 3, 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class SizeStatistics:
    """Numbers and sizes of the bodies of a tray; see `BodyEstimate`.

    Parameters
    ----------
    bodies, mean_size, weighted_size, clustered_share, clusters : Measured
        NaN when no bead is known.
    counts : ndarray (5,)
        Bodies of 1, 2, 3, 4 to 6, and 7 or more beads.
    """

    bodies: Measured = UNKNOWN_MEASURED
    mean_size: Measured = UNKNOWN_MEASURED
    weighted_size: Measured = UNKNOWN_MEASURED
    clustered_share: Measured = UNKNOWN_MEASURED
    clusters: Measured = UNKNOWN_MEASURED
    counts: NDArray[np.float64]


def bodies_of(beads: Iterable[int], bonds: Iterable[tuple[int, int]]) -> dict[int, int]:
    """Connected components of the bonds: for each bead the lowest number of a bead of its body.

    Parameters
    ----------
    beads : iterable of int
    bonds : iterable of (int, int)
        Bonds. Beads that are not among `beads` may join others.
    """
    root = {bead: bead for bead in beads}
    members = list(root)

    def find_root(bead: int) -> int:
        while root.setdefault(bead, bead) != bead:
            root[bead] = root[root[bead]]
            bead = root[bead]
        return bead

    for first, second in bonds:
        low, high = sorted((find_root(first), find_root(second)))
        root[high] = low
    return {bead: find_root(bead) for bead in members}


def joined_bodies(
    bond: Bond, bonds: Iterable[Bond], time: float
) -> tuple[frozenset[int], frozenset[int]]:
    """The beads of the two bodies that a bond joins, as of a time, [s].

    Parameters
    ----------
    bond : Bond
    bonds : iterable of Bond
        All bonds, with `bond` or without it. If others joined the two bodies before that time,
        both results are the same.
    time : float, [s]
    """
    older = [other.ids for other in bonds if other.start <= time and other.ids != bond.ids]
    body_of = bodies_of({bead for ids in [bond.ids, *older] for bead in ids}, older)
    first, second = (
        frozenset(bead for bead, root in body_of.items() if root == body_of[own])
        for own in bond.ids
    )
    return first, second


def possible_merges(
    body_of: Mapping[int, int],
    pairs: NDArray[np.int64],
    chances: NDArray[np.float64],
    odds: float,
) -> list[tuple[int, int, float]]:
    """Sizes of two bodies that may have merged, and the probability of it.

    Parameters
    ----------
    body_of : mapping of int to int
        See `bodies_of`.
    pairs : ndarray of int64, (n, 2)
        Beads that may be bonded.
    chances : ndarray (n,)
        Probability that free beads stay together for as long.
    odds : float
        Merges per encounter: the prior odds.
    """
    sizes = Counter(body_of.values())
    probabilities: dict[tuple[int, int], float] = {}
    for (first, second), chance in zip(pairs.tolist(), chances.tolist(), strict=True):
        if first in body_of and second in body_of and body_of[first] != body_of[second]:
            key = min(body_of[first], body_of[second]), max(body_of[first], body_of[second])
            probabilities[key] = max(probabilities.get(key, 0.0), odds / (odds + chance))
    return [(sizes[a], sizes[b], probability) for (a, b), probability in probabilities.items()]


def size_statistics(
    sizes: NDArray[np.int64],
    beads: int,
    merges: Sequence[tuple[int, int, float]],
) -> SizeStatistics:
    """Statistics of bodies of given sizes, with standard errors.

    Parameters
    ----------
    sizes : ndarray of int, (n,)
        Number of beads of each known body.
    beads : int
        Number of beads in the tray.
    merges : sequence of (size, size, probability)
        Bodies that may have merged, and the probability of it.
    """
    counted = int(sizes.sum())
    if counted == 0:
        return SizeStatistics(counts=np.full(5, math.nan))
    scale = beads / counted
    clusters = int(np.count_nonzero(sizes > 1))
    share_single = np.count_nonzero(sizes == 1) / counted
    values = {
        # Beads detected twice lower the scale, but not below the body that was seen.
        'bodies': max(scale * sizes.size, 1.0),
        'mean_size': counted / sizes.size,
        # Beads detected twice make bodies too large; missing beads are taken for single ones.
        'weighted_size': float(np.sum(sizes**2)) / counted * min(scale, 1.0),
        'clustered_share': 1.0 - share_single,
        'clusters': max(scale * clusters, min(clusters, 1)),
    }
    edges = (*(0, *_SIZE_CLASSES), np.inf)
    counts = [np.count_nonzero((sizes > low) & (sizes <= high)) for low, high in pairwise(edges)]
    errors = _errors(values, sizes.size, counted, beads, merges)
    return SizeStatistics(
        **{name: Measured(value, errors[name]) for name, value in values.items()},
        counts=scale * np.array(counts, dtype=np.float64),
    )


def _errors(
    values: dict[str, float],
    bodies: int,
    counted: int,
    beads: int,
    merges: Sequence[tuple[int, int, float]],
) -> dict[str, float]:
    """Standard errors from possible merges and from unknown beads."""
    probability = np.array([chance for _, _, chance in merges])
    pairs = np.array([(a, b) for a, b, _ in merges], dtype=np.float64).reshape(-1, 2)
    effects = {
        'bodies': np.ones(len(pairs)),
        'mean_size': np.full(len(pairs), counted / bodies**2),
        'weighted_size': 2.0 * pairs.prod(axis=1) / counted,
        'clustered_share': (np.where(pairs == 1.0, 1.0, 0.0).sum(axis=1)) / counted,
        'clusters': np.abs(1.0 - np.sum(pairs > 1.0, axis=1)),
    }
    # An unknown bead is a body of its own, part of a known body, or a double detection.
    missing = abs(beads - counted)
    unseen = {
        'bodies': missing * math.sqrt(1.0 / 12.0),
        'mean_size': values['mean_size'] * missing / (math.sqrt(12.0) * bodies),
        'weighted_size': 2.0 * values['weighted_size'] * missing / (math.sqrt(12.0) * counted),
        'clustered_share': missing / (math.sqrt(12.0) * counted),
        'clusters': missing / (math.sqrt(12.0) * 2.0),
    }
    errors = {}
    for name in values:
        expected = float(probability @ effects[name])
        variance = float((probability * (1.0 - probability)) @ effects[name] ** 2)
        errors[name] = math.sqrt(expected**2 + variance + unseen[name] ** 2)
    return errors
