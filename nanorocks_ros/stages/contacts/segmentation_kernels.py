"""Compiled part of the history of tracks: ways cut into straight flights, kinks between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.contacts.line_fits import (
    LINE,
    best_break,
    line_through,
    set_errors,
)
from nanorocks_ros.stages.contacts.residual_variance import Scatter, learn

if TYPE_CHECKING:
    from numpy.typing import NDArray

LONGEST = 48
"""Places of a flight that are used at most."""

FEWEST = 4
"""Places of a flight below which it says nothing of being straight."""

KINK = 2 * LINE + 3
"""Numbers of a kink in an array: lines before and after, `last`, `first`, `shared_error`."""

_ROOM = 4 * LONGEST
# On each side of a break that is looked for; two lines through fewer would fit anything.
_FEWEST_BREAK = 2
# What a break must gain in chi square: chance reaches 30 once in some ten thousand flights.
_GAIN = 30.0
# Scatter that is believed at least, over the stated variance: errors that a bead keeps for some
# pixels bend its way a little, and would cut it into pieces.
_LEAST_VARIANCE = 0.25
# Way over which light, shadow and outline misplace a bead alike, in radii.
_SAME = 0.5
# Places that the best break may move when all of the flight behind it is known.
_MOVED = 2


class Ways(NamedTuple):
    """The last places of some tracks, each in a slot of its own.

    Parameters
    ----------
    times, errors : ndarray (slots, places), [s], [m]
    places : ndarray (slots, places, 2), [m]
        Past the camera.
    ends : ndarray of int64, (slots,)
        How many places there are.
    firsts, befores : ndarray of int64, (slots,)
        First place of this flight and of the one before; -1 when that is not known.
    """

    times: NDArray[np.float64]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    ends: NDArray[np.int64]
    firsts: NDArray[np.int64]
    befores: NDArray[np.int64]

    @classmethod
    def empty(cls, slots: int) -> Ways:
        """Room for so many tracks."""
        return cls(
            np.empty((slots, _ROOM)),
            np.empty((slots, _ROOM, 2)),
            np.empty((slots, _ROOM)),
            *(np.zeros(slots, dtype=np.int64) for _ in range(3)),
        )

    def larger(self) -> Ways:
        """The same with room for twice as many."""
        return Ways(*(np.concatenate([one, np.zeros_like(one)]) for one in self))


@compiled
def begin(ways: Ways, slot: int) -> None:
    """Forget what was in a slot."""
    ways.ends[slot] = ways.firsts[slot] = 0
    ways.befores[slot] = -1


class Places(NamedTuple):
    """The beads of a picture, as `nanorocks_ros.records.Tracks` has them."""

    species: NDArray[np.int32]
    positions: NDArray[np.float64]
    displacement: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]


@compiled
def follow(
    ways: Ways,
    scatter: Scatter,
    time: float,
    gap: float,
    slots: NDArray[np.int64],
    beads: Places,
    known_radii: NDArray[np.float64],
    sizes: NDArray[np.float64],
    kinks: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Take the next places of the tracks that are seen.

    Parameters
    ----------
    ways, scatter
        Changed.
    time : float, [s]
    gap : float, [s]
        Without a place for longer, what happened is not known.
    slots : ndarray of int64, (n,)
        Of each track; -1 for one that is not followed.
    beads : Places
    known_radii : ndarray (species,), [m]
        NaN where the beads of a species are not alike.
    sizes : ndarray (slots, 2), [m]
        Written: radii, and the errors they are measured with.
    kinks : ndarray (n, KINK)
        Written where flights before and after a kink are both known now.

    Returns
    -------
    ndarray of int64, (kinks,)
        Which of the tracks these are.
    """
    found, count = np.empty(slots.size, dtype=np.int64), 0
    flight, place = np.empty(LINE), np.empty(2)
    for k in range(slots.size):
        slot = slots[k]
        if slot < 0 or not beads.seen[k]:
            continue
        radius = known_radii[beads.species[k]]
        if radius != radius:
            radius = beads.radii[k]
        sizes[slot, 0], sizes[slot, 1] = radius, beads.radius_errors[k]
        for c in range(2):
            place[c] = beads.positions[k, c] + beads.displacement[c]
        variance = scatter.variances[beads.species[k]]
        turned = _lost(ways, slot, time, gap, variance, radius, kinks[k])
        _add(ways, slot, time, place, beads.errors[k])
        if not turned:
            turned, ended = _cut(ways, slot, variance, radius, kinks[k], flight)
            if ended:
                learn(scatter, beads.species[k], flight)
        if turned:
            found[count] = k
            count += 1
    return found[:count]


@compiled
def _lost(
    ways: Ways,
    slot: int,
    time: float,
    gap: float,
    variance: float,
    radius: float,
    kink: NDArray[np.float64],
) -> bool:
    """Whether a track that was not seen for too long ends with a kink; it starts afresh."""
    end = ways.ends[slot]
    if end == 0 or not time - ways.times[slot, end - 1] > gap:
        return False
    turned = finish(ways, slot, variance, radius, kink)
    begin(ways, slot)
    return turned


@compiled
def _add(ways: Ways, slot: int, time: float, place: NDArray[np.float64], error: float) -> None:
    if ways.ends[slot] == _ROOM:
        _make_room(ways, slot)
    end = ways.ends[slot]
    ways.times[slot, end], ways.errors[slot, end] = time, error
    ways.places[slot, end] = place
    ways.ends[slot] += 1


@compiled
def finish(
    ways: Ways, slot: int, variance: float, radius: float, kink: NDArray[np.float64]
) -> bool:
    """Write the kink before the last flight of a track, which ends here; whether there is one."""
    return _kink(ways, slot, ways.ends[slot], variance, radius, kink)


@compiled
def _cut(
    ways: Ways,
    slot: int,
    variance: float,
    radius: float,
    kink: NDArray[np.float64],
    flight: NDArray[np.float64],
) -> tuple[bool, bool]:
    """Whether there is a kink of which all is known, and whether a flight ended."""
    begun, end = ways.firsts[slot], ways.ends[slot]
    first, gain = _break(ways, slot, begun, end)
    # The first place after a turn alone would take the last one before it along.
    settled = begun + first + _FEWEST_BREAK < end
    if settled and gain > _GAIN * max(variance, _LEAST_VARIANCE):
        turn = begun + first
        _line(ways, slot, begun, turn, flight)
        found = _kink(ways, slot, turn, variance, radius, kink)
        ways.befores[slot], ways.firsts[slot] = begun, turn
        return found, True
    if end - begun <= LONGEST:
        return False, False
    found = _kink(ways, slot, end, variance, radius, kink)
    ways.befores[slot] = -1
    ways.firsts[slot] += 1
    if found:
        _line(ways, slot, begun + 1, end, flight)
    return found, found


@compiled
def _break(ways: Ways, slot: int, first: int, end: int) -> tuple[int, float]:
    return best_break(
        ways.times[slot, first:end],
        ways.places[slot, first:end],
        ways.errors[slot, first:end],
        _FEWEST_BREAK,
    )


@compiled
def _line(ways: Ways, slot: int, first: int, end: int, row: NDArray[np.float64]) -> None:
    line_through(
        ways.times[slot, first:end],
        ways.places[slot, first:end],
        ways.errors[slot, first:end],
        row,
    )


@compiled
def _kink(
    ways: Ways, slot: int, end: int, variance: float, radius: float, kink: NDArray[np.float64]
) -> bool:
    """Write the kink where this flight began, when it ends at a place; whether there is one."""
    before, begun = ways.befores[slot], ways.firsts[slot]
    if before < 0:
        return False
    ways.befores[slot] = -1
    start = max(before, begun - LONGEST)
    first = start + _break(ways, slot, start, end)[0]
    if min(first - start, end - first) < FEWEST or abs(first - begun) > _MOVED:
        return False
    # What places share for some pixels differs between the ends of a flight.
    shared = math.sqrt(max(1.0 - variance, 0.0)) * ways.errors[slot, start:end].mean()
    _line(ways, slot, start, first, kink[:LINE])
    _line(ways, slot, first, end, kink[LINE : 2 * LINE])
    for line in (kink[:LINE], kink[LINE : 2 * LINE]):
        set_errors(line, variance, shared, _SAME * radius)
    kink[2 * LINE] = ways.times[slot, first - 1]
    kink[2 * LINE + 1] = ways.times[slot, first]
    kink[2 * LINE + 2] = shared
    return True


@compiled
def _make_room(ways: Ways, slot: int) -> None:
    first, before, end = ways.firsts[slot], ways.befores[slot], ways.ends[slot]
    keep = max(before if before >= 0 else first, first - LONGEST)
    left = end - keep
    for k in range(left):
        ways.times[slot, k] = ways.times[slot, keep + k]
        ways.errors[slot, k] = ways.errors[slot, keep + k]
        ways.places[slot, k] = ways.places[slot, keep + k]
    ways.firsts[slot], ways.ends[slot] = first - keep, left
    ways.befores[slot] = 0 if before >= 0 else -1
