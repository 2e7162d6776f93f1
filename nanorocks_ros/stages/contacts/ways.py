"""Compiled part of the history of tracks: ways cut into straight flights, kinks between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.stages.contacts.flights import (
    LINE,
    best_break,
    line_through,
    set_errors,
)

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
# Flights from which the scatter of places is learnt, their fewest places, and how far they lead
# in errors of a place: beads at rest are always misplaced alike.
_FLIGHTS, _FEWEST_PLACES, _LEAST_WAY = 200, 8, 8.0
_FEWEST_FLIGHTS = 10


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


class Scatter(NamedTuple):
    """How places scatter about straight flights, over what their errors say, by species.

    Parameters
    ----------
    known : ndarray (species, flights)
        Of the last flights, one after the other and then round again.
    counts : ndarray of int64, (species,)
        Flights so far.
    variances : ndarray (species,)
        Their median.
    """

    known: NDArray[np.float64]
    counts: NDArray[np.int64]
    variances: NDArray[np.float64]

    @classmethod
    def unknown(cls, species: int) -> Scatter:
        """Before the first flight."""
        return cls(
            np.zeros((species, _FLIGHTS)),
            np.zeros(species, dtype=np.int64),
            np.ones(species),
        )


@compiled
def begin(ways: Ways, slot: int) -> None:
    """Forget what was in a slot."""
    ways.ends[slot] = ways.firsts[slot] = 0
    ways.befores[slot] = -1


@compiled
def follow(
    ways: Ways,
    scatter: Scatter,
    time: float,
    gap: float,
    slots: NDArray[np.int64],
    species: NDArray[np.int32],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    radii: NDArray[np.float64],
    kinks: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Take the next places of some tracks.

    Parameters
    ----------
    ways, scatter
        Changed.
    time : float, [s]
    gap : float, [s]
        Without a place for longer, what happened is not known.
    slots : ndarray of int64, (n,)
    species : ndarray of int32, (n,)
    places : ndarray (n, 2), [m]
        Past the camera.
    errors : ndarray (n,), [m]
        Of a coordinate.
    radii : ndarray (n,), [m]
    kinks : ndarray (n, KINK)
        Written where flights before and after a kink are both known now.

    Returns
    -------
    ndarray of bool, (n,)
        Which these are.
    """
    found = np.zeros(slots.size, dtype=np.bool_)
    flight = np.empty(LINE)
    for k in range(slots.size):
        slot, variance = slots[k], scatter.variances[species[k]]
        end = ways.ends[slot]
        lost = end > 0 and time - ways.times[slot, end - 1] > gap
        if lost:
            found[k] = finish(ways, slot, variance, radii[k], kinks[k])
            begin(ways, slot)
        if ways.ends[slot] == _ROOM:
            _make_room(ways, slot)
        end = ways.ends[slot]
        ways.times[slot, end], ways.errors[slot, end] = time, errors[k]
        ways.places[slot, end] = places[k]
        ways.ends[slot] += 1
        if found[k]:
            continue
        found[k], ended = _cut(ways, slot, variance, radii[k], kinks[k], flight)
        if ended:
            _learn(scatter, species[k], flight)
    return found


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
def _learn(scatter: Scatter, species: int, flight: NDArray[np.float64]) -> None:
    """Scatter of places over what their errors say; those hold what pictures share, too."""
    used = flight[8]
    speed2 = flight[3] * flight[3] + flight[4] * flight[4]
    if used < _FEWEST_PLACES or speed2 < _LEAST_WAY * _LEAST_WAY * flight[6]:
        return
    count = scatter.counts[species]
    scatter.known[species, count % _FLIGHTS] = flight[7] / (2.0 * used - 4.0)
    scatter.counts[species] = count + 1
    if count + 1 >= _FEWEST_FLIGHTS:
        known = scatter.known[species, : min(count + 1, _FLIGHTS)]
        scatter.variances[species] = np.median(known)


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
