"""Numbers and sizes of bodies, from which beads stick to which."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

# Upper ends of the sizes counted together; larger ones are the last.
_SIZE_CLASSES = (1, 2, 3, 6)


def bodies_of(beads: Iterable[int], bonds: Iterable[tuple[int, int]]) -> dict[int, int]:
    """For each bead the least number of a bead of its body.

    Parameters
    ----------
    beads : iterable of int
    bonds : iterable of (int, int)
        Beads that stick together; those not among `beads` may join others.
    """
    root = {bead: bead for bead in beads}
    wanted = list(root)

    def find(one: int) -> int:
        while root.setdefault(one, one) != one:
            root[one] = root[root[one]]
            one = root[one]
        return one

    for first, second in bonds:
        low, high = sorted((find(first), find(second)))
        root[high] = low
    return {one: find(one) for one in wanted}


def size_fields(
    sizes: NDArray[np.int64],
    beads: int,
    merges: Sequence[tuple[int, int, float]],
) -> dict[str, Any]:
    """Fields of a `BodyEstimate` for bodies of some sizes.

    Parameters
    ----------
    sizes : ndarray of int, (n,)
        Beads of each body that is known.
    beads : int
        In the tray.
    merges : sequence of (size, size, probability)
        Bodies that may have joined, and how probable that is.
    """
    known = int(sizes.sum())
    if known == 0:
        return dict.fromkeys(_NUMBERS, math.nan) | {'sizes': np.full(5, math.nan)}
    scale = beads / known
    share_single = np.count_nonzero(sizes == 1) / known
    values = {
        'bodies': scale * sizes.size,
        'mean_size': known / sizes.size,
        # Beads counted twice make bodies too large; those that are missing, none larger.
        'weighted_size': float(np.sum(sizes**2)) / known * min(scale, 1.0),
        'clustered_share': 1.0 - share_single,
        'clusters': scale * np.count_nonzero(sizes > 1),
    }
    edges = (*(0, *_SIZE_CLASSES), np.inf)
    counts = [np.count_nonzero((sizes > low) & (sizes <= high)) for low, high in pairwise(edges)]
    errors = _errors(values, sizes.size, known, beads, merges)
    return values | errors | {'sizes': scale * np.array(counts, dtype=np.float64)}


_VALUES = ('bodies', 'mean_size', 'weighted_size', 'clustered_share', 'clusters')
_NUMBERS = (*_VALUES, *(f'{value}_error' for value in _VALUES))


def _errors(
    values: dict[str, float],
    bodies: int,
    known: int,
    beads: int,
    merges: Sequence[tuple[int, int, float]],
) -> dict[str, float]:
    """Standard errors, from merges that may have been and from beads that are not known."""
    probability = np.array([one for _, _, one in merges])
    pairs = np.array([(a, b) for a, b, _ in merges], dtype=np.float64).reshape(-1, 2)
    effects = {
        'bodies': np.ones(len(pairs)),
        'mean_size': np.full(len(pairs), known / bodies**2),
        'weighted_size': 2.0 * pairs.prod(axis=1) / known,
        'clustered_share': (np.where(pairs == 1.0, 1.0, 0.0).sum(axis=1)) / known,
        'clusters': np.abs(1.0 - np.sum(pairs > 1.0, axis=1)),
    }
    # A bead that is not known is one of its own, part of a known body, or was counted twice.
    missing = abs(beads - known)
    unseen = {
        'bodies': missing * math.sqrt(1.0 / 12.0),
        'mean_size': values['mean_size'] * missing / (math.sqrt(12.0) * bodies),
        'weighted_size': 2.0 * values['weighted_size'] * missing / (math.sqrt(12.0) * known),
        'clustered_share': missing / (math.sqrt(12.0) * known),
        'clusters': missing / (math.sqrt(12.0) * 2.0),
    }
    found = {}
    for name in _VALUES:
        expected = float(probability @ effects[name])
        scatter = float((probability * (1.0 - probability)) @ effects[name] ** 2)
        found[f'{name}_error'] = math.sqrt(expected**2 + scatter + unseen[name] ** 2)
    return found
