"""The acceleration that all beads share between contacts, such as gravity, from their tracks.

Short pieces of tracks are fitted with parabolas. A piece with a contact in it is no parabola, so
that the pieces that are fitted well show free flights; their median does not follow the rest.
Beads that lie on something do not fall, and hardly move: they are left out. So are those that roll
on something: along the acceleration that others have in common, they keep their place, which a
free bead does not.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.flights.bend_fits import BEND_SIZE, MIN_BEND_POINTS, write_bend

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

_NS = 1e9
PIECE = MIN_BEND_POINTS
"""Positions of a piece of a track."""

# Largest gap in it, in intervals between frames.
_MAX_GAP = 1.5
# Least number of pieces, and largest chi square of a piece over the lower quartile of all.
_LEAST_PIECES, _MAX_CHI_SQUARE = 6, 3.0
# Least path along a piece, in radii.
_LEAST_PATH = 0.5
# Errors by which an acceleration must differ from 0.
_SIGMAS = 5.0
# Largest scatter of the accelerations of curved pieces, over their median, if they have one in
# common; and path of a bead that is held, along it, over that of one which is thrown up and falls
# back, the shortest of all free ones.
_COMMON, _HELD = 0.3, 0.5
# Normal deviation over the median of absolute deviations; error of a median over that of a mean.
_MAD, _MEDIAN_ERROR = 1.4826, 1.2533


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyAcceleration:
    """Acceleration of free beads in the image plane.

    Parameters
    ----------
    value : tuple of 2 floats, [m/s^2]
        Along columns and rows; NaN when unknown.
    error : float, [m/s^2]
        Of a component.
    pieces : int
        Pieces of tracks that it rests on.
    """

    value: tuple[float, float] = (math.nan, math.nan)
    error: float = math.nan
    pieces: int = 0

    @property
    def size(self) -> float:
        """Size of the acceleration, [m/s^2]."""
        return math.hypot(*self.value)

    @property
    def is_seen(self) -> bool:
        """Whether it is not 0."""
        return self.size > _SIGMAS * self.error

    @property
    def correction(self) -> tuple[float, float]:
        """What contacts are to be corrected for, [m/s^2]: 0 unless it is seen."""
        return self.value if self.is_seen else (0.0, 0.0)


def steady_acceleration(tracks: Iterable[Tracks]) -> SteadyAcceleration:
    """The acceleration by all tracks of a tray.

    Parameters
    ----------
    tracks : iterable of Tracks
        In order of time.
    """
    fits = _fits(_by_bead(tracks))
    if len(fits) < _LEAST_PIECES:
        return SteadyAcceleration()
    chi_square = fits[:, 8]
    good = fits[chi_square <= _MAX_CHI_SQUARE * np.quantile(chi_square, 0.25)]
    good = good[~_are_held(good)]
    if len(good) < _LEAST_PIECES:
        return SteadyAcceleration()
    accelerations = good[:, 5:7]
    median = np.median(accelerations, axis=0)
    spread = _MAD * np.median(np.abs(accelerations - median), axis=0)
    # Pieces overlap by half.
    error = float(spread.max()) * _MEDIAN_ERROR / math.sqrt(0.5 * len(good))
    x, y = median.tolist()
    return SteadyAcceleration(value=(x, y), error=error, pieces=len(good))


def _are_held(fits: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pieces of beads that something keeps from falling with the others."""
    accelerations, errors = fits[:, 5:7], fits[:, 7]
    curved = accelerations[np.hypot(*accelerations.T) > _SIGMAS * errors]
    if len(curved) < _LEAST_PIECES:
        return np.zeros(len(fits), dtype=bool)
    common = np.median(curved, axis=0)
    size = math.hypot(*common.tolist())
    if _MAD * np.median(np.hypot(*(curved - common).T)) > _COMMON * size:
        return np.zeros(len(fits), dtype=bool)
    # Along it, at the ends and in the middle of a piece; the middle is where a free one turns.
    half = 0.5 * fits[:, 1]
    speed, bend = np.abs(fits[:, 3:5] @ common) / size, np.abs(accelerations @ common) / size
    fallen = np.maximum(2.0 * speed * half, speed * half + 0.5 * bend * half**2)
    return np.asarray(fallen < _HELD * 0.5 * size * half**2)


def _by_bead(tracks: Iterable[Tracks]) -> list[NDArray[np.float64]]:
    """Time, position, its error and radius of each bead where it is seen, (n, 5) each."""
    beads: dict[int, list[tuple[float, ...]]] = defaultdict(list)
    first_ns: int | None = None
    for record in tracks:
        first_ns = record.stamp_ns if first_ns is None else first_ns
        time = (record.stamp_ns - first_ns) / _NS
        places = record.positions + record.displacement
        for k in np.flatnonzero(record.seen).tolist():
            error, radius = float(record.position_errors[k]), float(record.radii[k])
            beads[int(record.ids[k])].append((time, *places[k].tolist(), error, radius))
    return [np.array(rows) for rows in beads.values() if len(rows) >= PIECE]


def _fits(beads: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Parabolas through the pieces of all tracks, (n, BEND_SIZE)."""
    steps = [np.diff(bead[:, 0]) for bead in beads]
    if not steps:
        return np.empty((0, BEND_SIZE))
    usual = float(np.median(np.concatenate(steps)))
    rows = []
    for bead, step in zip(beads, steps, strict=True):
        for first in range(0, len(bead) - PIECE + 1, PIECE // 2):
            if step[first : first + PIECE - 1].max() > _MAX_GAP * usual:
                continue
            row = np.zeros(BEND_SIZE)
            columns = np.ascontiguousarray(bead[first : first + PIECE].T)
            places = np.ascontiguousarray(columns[1:3].T)
            path = float(np.hypot(*np.ptp(places, axis=0)))
            moves = path > _LEAST_PATH * columns[4].mean()
            if moves and write_bend(columns[0], places, columns[3], row):
                rows.append(row)
    return np.array(rows).reshape(-1, BEND_SIZE)
