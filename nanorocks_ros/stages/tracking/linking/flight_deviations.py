"""Errors of places, measured by how far beads lie off straight paths.

A bead that flies freely passes the middle of its path at the middle of the time. How far its
measured place lies off the middle between an earlier and a later one shows the errors of the
three, as far as they differ. Errors of neighbouring places are alike: light, the pixel grid and
the blocks of a codec move a whole part of an outline for as long as the bead stays there. So the
deviations grow with the length of the path, until the errors at its ends have nothing in common.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.numerics.median import quantile_of
from nanorocks_ros.stages.tracking.linking.track_store import ALIKE_RADII

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Lengths of half a path, each twice the one before, [px].
_PATHS_PX = (1.0, 2.0, 4.0, 8.0, 16.0)
# Longest half of a path over its nominal length, half way to the next one: where a bead moves
# further between two frames the deviation belongs to a longer path.
_LONGEST = math.sqrt(2.0)
# Longest ratio of the times of the two halves.
_EVEN = 1.5
# Tracks with room; numbers of tracks ascend, so that two of one remainder hardly live together.
_SLOTS = 4096
# Deviations kept of each species and length; fewest that tell; new ones between two fits.
_KEPT, _FEWEST, _EVERY = 512, 48, 24
_ROUNDS = 30
# Smallest ratio of the variances of deflected and straight paths: closer ones are one kind.
_LEAST_CONTRAST = 4.0
# Smallest share of straight paths: with fewer, slight kicks pass for errors.
_FEWEST_STRAIGHT = 0.5

# Largest growth of the deviations, as a power of the path: the middle between that of errors that
# change in independent steps, 1/2, and that of kinks, 1, such as the many slight ones that a heavy
# bead gets from light ones. Longer paths than those that grow faster tell nothing.
_MOST_GROWTH = 0.75
# Longest half of the shortest path, [px]: over longer ones alone, as of fast beads in a film of
# few frames, errors cannot be told from slight kicks. Up to it errors may grow at any rate: those
# from the pixel grid are alike below.
_FIRST_PX = 2.0
# Longest half of a path in radii: the length next to it is used.
_LONGEST_RADII = math.sqrt(2.0)
# Smallest share of the variance of errors along a path that its deviations show and that is made
# up for; with less, chance would be.
_LEAST_SEEN = 0.5
# Decile of an exponential variable over half of its mean.
_DECILE = 0.2107


class FlightPaths(NamedTuple):
    """Paths begun, and the deviations of complete ones.

    Parameters
    ----------
    lengths : ndarray (lengths,), [px]
        Of half a path.
    tracks : ndarray of int64, (slots,)
        The track of each slot.
    stages : ndarray of int64, (slots, lengths)
        Number of places so far.
    places : ndarray (slots, lengths, 2, 4)
        Time, column, row and variance of a coordinate.
    squares : ndarray (lengths, kept)
        Squares of deviations in the plane over the stated variance: ring buffers.
    counts : ndarray of int64, (lengths,)
        Number of deviations so far.
    variances : ndarray (lengths,)
        Variance over the stated one; NaN where it is unknown.
    """

    lengths: NDArray[np.float64]
    tracks: NDArray[np.int64]
    stages: NDArray[np.int64]
    places: NDArray[np.float64]
    squares: NDArray[np.float64]
    counts: NDArray[np.int64]
    variances: NDArray[np.float64]


class FlightDeviations:
    """Errors of the places of one species over the stated ones, from straight paths.

    Parameters
    ----------
    radius_px : float, [px]
        Of a bead. Paths are about as long: few beads fly straight much further in a dense tray.
    assumed : float, [px]
        Error that all places of a bead share, until flights tell the errors.
    hidden : bool
        Whether that error is never seen in flights, as that of chalk that turns with a bead.

    Attributes
    ----------
    paths : FlightPaths
        `add_places` adds the places of each frame.
    """

    def __init__(self, radius_px: float, *, assumed: float = 0.0, hidden: bool = False) -> None:
        self._assumed = assumed
        self._remaining = assumed if hidden else 0.0
        used = np.array(_PATHS_PX) <= _LONGEST_RADII * radius_px
        count = max(int(used.sum()), 1)
        lengths = np.array(_PATHS_PX)[:count]
        self._alike = ALIKE_RADII * radius_px
        self.paths = FlightPaths(
            lengths,
            np.full(_SLOTS, -1, dtype=np.int64),
            np.zeros((_SLOTS, count), dtype=np.int64),
            np.empty((_SLOTS, count, 2, 4)),
            np.empty((count, _KEPT)),
            np.zeros(count, dtype=np.int64),
            np.full(count, np.nan),
        )

    @property
    def scaling(self) -> tuple[float, float]:
        """True error of a place: over the stated one, and what is added to it in squares."""
        known = self.known()
        if not known:
            return 1.0, self._assumed
        length, factor = known[-1]
        white = known[0][1] ** 2
        # Errors over a longer path would differ more: correlations fall off exponentially.
        kept = math.exp(-length / self._alike)
        seen = max(1.0 - (4.0 * kept - kept * kept) / 3.0, _LEAST_SEEN)
        return math.sqrt(white + (factor * factor - white) / seen), self._remaining

    def known(self) -> list[tuple[float, float]]:
        """Errors over paths of ascending lengths.

        Returns
        -------
        list of tuples of 2 floats
            Length of half a path, [px], and by how much the errors at its
            ends differ, over the stated errors. As far as errors, not kinks, explain it.
        """
        known: list[tuple[float, float]] = []
        for length, variance in zip(
            self.paths.lengths.tolist(), self.paths.variances.tolist(), strict=True
        ):
            if math.isnan(variance):
                if known or length >= _FIRST_PX:
                    break
                continue
            factor = math.sqrt(variance)
            if known:
                shorter, last = known[-1]
                if length > _FIRST_PX and factor > last * (length / shorter) ** _MOST_GROWTH:
                    break
                # Errors over a longer path are not smaller: that is chance.
                factor = max(factor, last)
            known.append((length, factor))
        return known


@compiled
def add_places(
    paths: FlightPaths,
    time: float,
    ids: NDArray[np.int32],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> None:
    """Add the places of the beads seen in the next frame.

    Parameters
    ----------
    paths : FlightPaths
        Changed.
    time : float, [s]
    ids : ndarray of int32, (n,)
        Numbers of their tracks.
    places : ndarray (n, 2), [px]
        In a frame in which free beads fly straight.
    errors : ndarray (n,), [px]
        Stated errors of a coordinate.
    """
    n_due = np.zeros(paths.lengths.size, dtype=np.int64)
    due = np.empty((paths.lengths.size, _KEPT))
    for k in range(ids.size):
        slot = ids[k] % _SLOTS
        if paths.tracks[slot] != ids[k]:
            paths.tracks[slot] = ids[k]
            paths.stages[slot] = 0
        variance = errors[k] * errors[k]
        for c in range(paths.lengths.size):
            square = _advance(
                paths, slot, c, paths.lengths[c], (time, places[k, 0], places[k, 1], variance)
            )
            if square >= 0.0:
                count = paths.counts[c]
                paths.squares[c, count % _KEPT] = square
                paths.counts[c] = count + 1
                if count + 1 >= _FEWEST and (count + 1) % _EVERY == 0:
                    n_due[c] = min(count + 1, _KEPT)
                    due[c, : n_due[c]] = paths.squares[c, : n_due[c]]
    # In a frame with many beads several fits are due: the last one counts.
    for c in range(paths.lengths.size):
        if n_due[c]:
            paths.variances[c] = straight_variance(due[c, : n_due[c]])


@inlined
def _advance(
    paths: FlightPaths,
    slot: int,
    c: int,
    length: float,
    place: tuple[float, float, float, float],
) -> float:
    """Add a place to a path; the squared deviation where it is complete now, otherwise -1."""
    stage = paths.stages[slot, c]
    first, middle = paths.places[slot, c, 0], paths.places[slot, c, 1]
    time, x, y, variance = place
    square = -1.0
    if stage == 1:
        path = math.hypot(x - first[1], y - first[2])
        if path < length:
            return -1.0
        if path <= _LONGEST * length:
            middle[0], middle[1], middle[2], middle[3] = time, x, y, variance
            paths.stages[slot, c] = 2
            return -1.0
    if stage == 2:
        before, after = middle[0] - first[0], time - middle[0]
        if after * _EVEN < before:
            return -1.0
        if after <= _EVEN * before:
            share = before / (before + after)
            dx = middle[1] - (1.0 - share) * first[1] - share * x
            dy = middle[2] - (1.0 - share) * first[2] - share * y
            total = middle[3] + (1.0 - share) ** 2 * first[3] + share**2 * variance
            square = (dx * dx + dy * dy) / total
    first[0], first[1], first[2], first[3] = time, x, y, variance
    paths.stages[slot, c] = 1
    return square


@compiled
def straight_variance(squares: NDArray[np.float64]) -> float:
    """Variance of the deviations of straight paths among deflected ones.

    Two normal distributions about the same middle, that of the straight paths the narrower one:
    shares and variances by expectation maximisation.

    Parameters
    ----------
    squares : ndarray (n,)
        Squares of deviations in the plane.

    Returns
    -------
    float
        Of a coordinate; NaN where straight paths are few.
    """
    narrow = quantile_of(squares, 0.1) / _DECILE
    wide = max(float(squares.mean()), _LEAST_CONTRAST * narrow)
    share = 0.5
    if not narrow > 0.0:
        return np.nan
    for _ in range(_ROUNDS):
        total, total_squares, rest, rest_squares = 0.0, 0.0, 0.0, 0.0
        # The densities of both over each other, as one exponential of the square.
        odds, falls = share / narrow * wide, 0.5 / narrow - 0.5 / wide
        for square in squares:
            straight = odds * math.exp(-falls * square)
            sum_of_both = straight + 1.0 - share
            probability = straight / sum_of_both if sum_of_both > 0.0 else 0.0
            total += probability
            total_squares += probability * square
            rest += 1.0 - probability
            rest_squares += (1.0 - probability) * square
        share = total / squares.size
        if not total > 0.0:
            return np.nan
        narrow = max(0.5 * total_squares / total, 1e-30)
        wide = max(0.5 * rest_squares / max(rest, 1e-9), _LEAST_CONTRAST * narrow)
    return narrow if share >= _FEWEST_STRAIGHT else np.nan
