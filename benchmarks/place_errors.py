"""Stated errors of places and radii in a film over the true ones.

Tested by ``test/validation/test_place_errors.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from benchmarks.film_truth import FilmTruth
    from nanorocks_ros.records import Tracks

_NS = 1e9
# Time after the kick from which errors are compared: they are learnt from flights, [s].
_LEARNT = 1.0
# Largest distance of a measured bead from the true one, in radii.
_REACH = 0.7
# Standard deviation of a normal variate over the median of its absolute values.
_DEVIATION = 1.4826
_FEWEST = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceErrors:
    """Errors in one species.

    Parameters
    ----------
    shift : float, [px]
        Length of the median error of all beads of the species, beside those of the others: what
        light and shade displace alike. It changes neither speeds nor distances within a species.
    true, white : float, [px]
        True error of a coordinate about that shift, from the median of absolute values; and the
        part of it that differs between frames.
    place_ratio, radius_ratio : float
        Median of the stated errors over the true one.
    """

    shift: float
    true: float
    white: float
    place_ratio: float
    radius_ratio: float


def place_errors(
    film: FilmTruth, tracks: Sequence[Tracks], epoch_ns: int
) -> tuple[PlaceErrors | None, ...]:
    """Compare errors in each species; None where too few beads are found.

    What the scale and the perspective displace is not counted: they are linear in the place and
    in its product with the height, and a bead above the floor seems larger. Nor is what displaces
    all beads of a frame alike, such as a sway of the camera: it changes no distance.
    """
    count = int(film.species.max()) + 1
    rows: list[list[NDArray[np.float64]]] = [[] for _ in range(count)]
    for record in tracks:
        number = round((record.stamp_ns - epoch_ns) / _NS * film.frame_rate)
        if (
            film.shake + _LEARNT
            <= number / film.frame_rate
            < len(film.positions) / film.frame_rate
        ):
            for kind in range(count):
                rows[kind].append(_pairs(film, record, number, kind))
    pairs = [np.concatenate(parts) if parts else np.empty((0, 11)) for parts in rows]
    if sum(map(len, pairs)) < _FEWEST:
        return (None,) * count
    together = np.concatenate(pairs)
    together[:, 4:6] -= _design(together) @ _offsets(together)
    _remove_common(together)
    ends = np.cumsum([len(part) for part in pairs])
    return tuple(
        _errors_of(part, film.scale) if len(part) >= _FEWEST else None
        for part in np.split(together, ends[:-1])
    )


def _pairs(film: FilmTruth, record: Tracks, number: int, kind: int) -> NDArray[np.float64]:
    """Frame, track, place, error of it, stated error, height, radius error and its stated one."""
    own = np.flatnonzero(record.seen & (record.species == kind))
    beads = np.flatnonzero(film.species == kind)
    apart, nearest = cKDTree(film.positions[number, beads]).query(record.positions[own])
    near = apart < _REACH * film.radii[beads[nearest]]
    own, bead = own[near], beads[nearest[near]]
    return np.column_stack(
        [
            np.full(own.size, number),
            1000 * record.ids[own] + bead,
            record.positions[own],
            record.positions[own] - film.positions[number, bead],
            record.position_errors[own],
            film.heights[number, bead],
            record.radii[own] - film.radii[bead] * film.magnification[number, bead],
            record.radius_errors[own],
        ]
    )


def _design(pairs: NDArray[np.float64]) -> NDArray[np.float64]:
    places, heights = pairs[:, 2:4], pairs[:, 7:8]
    return np.column_stack([np.ones(len(pairs)), places, places * heights, heights])


def _offsets(pairs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of offset, scale and perspective, (6, 2), from errors that are not outliers."""
    apart = np.hypot(*pairs[:, 4:6].T)
    usual = pairs[apart < 4.0 * np.median(apart)]
    coefficients: NDArray[np.float64] = np.linalg.lstsq(_design(usual), usual[:, 4:6], rcond=None)[
        0
    ]
    return coefficients


def _remove_common(pairs: NDArray[np.float64]) -> None:
    """Subtract the median error of each frame."""
    order = np.argsort(pairs[:, 0], kind='stable')
    starts = np.flatnonzero(np.diff(pairs[order, 0], prepend=-1.0))
    for rows in np.split(order, starts[1:]):
        pairs[rows, 4:6] -= np.median(pairs[rows, 4:6], axis=0)


def _errors_of(pairs: NDArray[np.float64], scale: float) -> PlaceErrors:
    order = np.lexsort((pairs[:, 0], pairs[:, 1]))
    pairs = pairs[order]
    shift = np.median(scale * pairs[:, 4:6], axis=0)
    errors = scale * pairs[:, 4:6] - shift
    same = (pairs[2:, 1] == pairs[:-2, 1]) & (pairs[2:, 0] - pairs[:-2, 0] == 2)
    second = (errors[2:] - 2.0 * errors[1:-1] + errors[:-2])[same]
    true = _DEVIATION * float(np.median(np.abs(errors)))
    last = np.append(pairs[1:, 1] != pairs[:-1, 1], True)
    of_radii = _DEVIATION * float(np.median(np.abs(pairs[last, 8])))
    return PlaceErrors(
        shift=float(np.hypot(*shift)),
        true=true,
        white=_DEVIATION * float(np.median(np.abs(second))) / float(np.sqrt(6.0)),
        place_ratio=scale * float(np.median(pairs[:, 6])) / true,
        radius_ratio=float(np.median(pairs[last, 9])) / max(of_radii, 1e-12),
    )
