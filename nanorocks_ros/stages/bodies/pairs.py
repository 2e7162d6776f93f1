"""Pairs of beads beside each other in the picture, and for how long their separation stays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Sums of radii within which two beads may touch, and errors of both places and radii besides.
_REACH, _REACH_ERRORS = 1.03, 2.0
# What an uneven outline and the light add to the error of a radius, over it.
_OUTLINE = 0.02
# Half of the range in which each component of the separation of a body stays, in errors of it.
_TOLERANCE = 3.0
# Jitter alone makes it this part of that.
_LEAST_RANGE = 0.25
# Of a body that is known, before it is called broken, and for how long, [s].
_BROKEN, _BROKEN_TIME = 2.0, 0.7
# A track that jumps to a neighbour in its cluster moves on with it: so long, [s], without leaving
# the range of a body, no further than so many sums of radii.
_STEADY, _STEADY_REACH = 0.3, 2.5
# Over which places are smoothed, and the separation of a body follows a slow turn, [s].
_SMOOTH, _FOLLOW = 0.1, 2.0
# No body is younger, [s].
_YOUNGEST = 0.3
# Two of which one is not seen are remembered so long, [s].
_HIDDEN = 1.5
# And those of a body, so long, [s].
_FORGOTTEN = 60.0
_SHIFT = 32


class Beads(NamedTuple):
    """Beads seen in one picture.

    Parameters
    ----------
    ids : ndarray of int64, (n,)
        Rising.
    places : ndarray (n, 2), [m]
        Any origin that all share.
    errors, radii, radius_errors : ndarray (n,), [m]
    variances : ndarray (n,), [m^2/s^2]
        Mean square of a component of the velocity of beads of that kind.
    height : float, [m]
        Of the tray.
    """

    ids: NDArray[np.int64]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    variances: NDArray[np.float64]
    height: float


class Bond(NamedTuple):
    """Two beads that are one body.

    Parameters
    ----------
    ids : tuple of 2 int
    start : float, [s]
        Since when they stay beside each other.
    offset : tuple of 2 floats, [m]
        From the first centre to the second.
    tolerance : float, [m]
    """

    ids: tuple[int, int]
    start: float
    offset: tuple[float, float]
    tolerance: float


class Pairs:
    """Follows all pairs of beads that touch in the picture.

    Parameters
    ----------
    chance : callable
        Of ways (n,) and ranges (n,), the chance that free beads do the same.
    """

    def __init__(
        self,
        chance: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]],
    ) -> None:
        self._chance = chance
        self.clear()

    def clear(self) -> None:
        """Forget all pairs."""
        self._rows = np.empty(0, dtype=_ROW)

    def push(
        self, time: float, beads: Beads, largest: float
    ) -> tuple[list[Bond], list[tuple[int, int]]]:
        """Take the beads of the next picture.

        Parameters
        ----------
        time : float, [s]
        beads : Beads
        largest : float
            Pairs are a body when the chance that free beads do the same is lower.

        Returns
        -------
        bonds : list of Bond
            New ones.
        broken : list of (int, int)
            Bodies that are none any more.
        """
        keys, first, second = touching(beads)
        rows = self._rows
        self._follow_seen(time, beads)
        kept = rows[self._alive(time, keys, beads)]
        fresh = ~np.isin(keys, kept['key'])
        added = _new_rows(time, beads, keys[fresh], first[fresh], second[fresh])
        rows = np.concatenate([kept, added])
        self._rows = rows[np.argsort(rows['key'], kind='stable')]
        bonds = self._bonds(time, largest)
        return bonds, [_ids(one) for one in self._rows['key'][self._fall(time)]]

    def adopt(self, time: float, beads: Beads, bonds: list[Bond]) -> None:
        """Follow pairs that are bodies for other reasons, until they come apart."""
        if not bonds:
            return
        keys = np.array([one.ids[0] << _SHIFT | one.ids[1] for one in bonds], dtype=np.int64)
        where = [np.searchsorted(beads.ids, part) for part in _parts(keys)]
        fresh = ~np.isin(keys, self._rows['key'])
        first, second = (one[fresh] for one in where)
        added = _new_rows(time, beads, keys[fresh], first, second)
        rows = np.concatenate([self._rows, added])
        self._rows = rows[np.argsort(rows['key'], kind='stable')]
        own = np.isin(self._rows['key'], keys)
        self._rows['bonded'] |= own
        self._rows['stayed'][own] = time
        self._rows['offset'][own] = self._rows['smooth'][own]

    def pending(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Pairs that may yet turn out to be bodies, (n, 2), and the chance that free beads do so.

        Only those that stay long enough for it to be improbable.
        """
        rows = self._rows[~self._rows['bonded']]
        chances = self._chances(rows)
        some = chances < 0.1
        keys = rows['key'][some]
        return np.column_stack([keys >> _SHIFT, keys & ((1 << _SHIFT) - 1)]), chances[some]

    def _alive(self, time: float, keys: NDArray[np.int64], beads: Beads) -> NDArray[np.bool_]:
        """Which pairs stay: those that touch, those of which one is hidden, and bodies."""
        rows = self._rows
        if not rows.size:
            return np.zeros(0, dtype=np.bool_)
        both = np.isin(rows['key'] >> _SHIFT, beads.ids)
        both &= np.isin(rows['key'] & ((1 << _SHIFT) - 1), beads.ids)
        hidden = ~both & (time - rows['last'] < _HIDDEN)
        body = rows['bonded'] & (time - rows['last'] < _FORGOTTEN)
        return np.asarray(np.isin(rows['key'], keys) | hidden | body)

    def _follow_seen(self, time: float, beads: Beads) -> None:
        """Separations of the pairs of which both are seen."""
        rows = self._rows
        if not rows.size or not beads.ids.size:
            return
        where = [np.searchsorted(beads.ids, part) for part in _parts(rows['key'])]
        where = [np.minimum(one, beads.ids.size - 1) for one in where]
        both = (beads.ids[where[0]] == rows['key'] >> _SHIFT) & (
            beads.ids[where[1]] == rows['key'] & ((1 << _SHIFT) - 1)
        )
        here = np.flatnonzero(both)
        i, j = where[0][here], where[1][here]
        apart = beads.places[j] - beads.places[i]
        now = rows[here]
        step = time - now['last']
        now['smooth'] += (apart - now['smooth']) * -np.expm1(-step / _SMOOTH)[:, None]
        now['low'] = np.minimum(now['low'], now['smooth'])
        now['high'] = np.maximum(now['high'], now['smooth'])
        now['tolerance'] = _TOLERANCE * np.hypot(beads.errors[i], beads.errors[j])
        # Whoever is free flies on as fast as when they met, though all others may stick meanwhile.
        usual = np.sqrt(beads.variances[i] + beads.variances[j])
        now['speed'] = np.maximum(now['speed'], usual)
        now['way'] += now['speed'] * step
        now['last'] = time
        moved = (now['high'] - now['low'] > 2.0 * now['tolerance'][:, None]).any(axis=1)
        again = moved & ~now['bonded']
        _restart(now, again, apart, time)
        now['speed'][again] = usual[again]
        away = np.abs(now['smooth'] - now['offset']).max(axis=1)
        stays = away < _BROKEN * now['tolerance']
        near = np.hypot(*apart.T) < _STEADY_REACH * (beads.radii[i] + beads.radii[j])
        stays |= _settled(now, stays, apart, time) & near
        now['stayed'][stays] = time
        now['offset'] += np.where(
            stays[:, None], (apart - now['offset']) * -np.expm1(-step / _FOLLOW)[:, None], 0.0
        )
        rows[here] = now

    def _chances(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        ranges = 0.5 * (rows['high'] - rows['low']).max(axis=1)
        return self._chance(rows['way'], np.maximum(ranges, _LEAST_RANGE * rows['tolerance']))

    def _bonds(self, time: float, largest: float) -> list[Bond]:
        rows = self._rows
        found = (
            ~rows['bonded'] & (self._chances(rows) < largest) & (time - rows['start'] >= _YOUNGEST)
        )
        rows['bonded'] |= found
        rows['stayed'][found] = time
        rows['offset'][found] = 0.5 * (rows['low'][found] + rows['high'][found])
        return [
            Bond(
                _ids(one['key']),
                float(one['start']),
                (float(one['offset'][0]), float(one['offset'][1])),
                float(one['tolerance']),
            )
            for one in rows[found]
        ]

    def _fall(self, time: float) -> NDArray[np.bool_]:
        """Bodies whose beads, both seen, are apart for too long; they are free pairs again."""
        rows = self._rows
        fall = rows['bonded'] & (rows['last'] - rows['stayed'] > _BROKEN_TIME)
        rows['bonded'] &= ~fall
        _restart(rows, fall, rows['smooth'], time)
        return np.asarray(fall)


_ROW = np.dtype(
    [
        ('key', np.int64),
        ('smooth', np.float64, 2),
        ('low', np.float64, 2),
        ('high', np.float64, 2),
        ('offset', np.float64, 2),
        ('tolerance', np.float64),
        ('speed', np.float64),
        ('way', np.float64),
        ('start', np.float64),
        ('last', np.float64),
        ('stayed', np.float64),
        ('bonded', np.bool_),
    ]
)


def touching(
    beads: Beads,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Keys of the pairs that may touch, and the rows of their beads, each (n,).

    Centres are no further apart in the picture than the radii let them be, and no nearer than
    the height of the tray lets beads be that lie over each other.
    """
    errors = np.hypot(beads.radius_errors, _OUTLINE * beads.radii * (beads.radius_errors > 0.0))
    variances = errors**2 + beads.errors**2
    if beads.ids.size < 2:
        nothing = np.empty(0, dtype=np.int64)
        return nothing, nothing, nothing
    furthest = 2.0 * (_REACH * beads.radii.max() + _REACH_ERRORS * np.sqrt(variances.max()))
    found = cKDTree(beads.places).query_pairs(furthest, output_type='ndarray')
    first, second = found.min(axis=1), found.max(axis=1)
    distance = np.hypot(*(beads.places[second] - beads.places[first]).T)
    radii = beads.radii[first] + beads.radii[second]
    slack = _REACH_ERRORS * np.sqrt(variances[first] + variances[second])
    above = np.maximum(beads.height - radii, 0.0)
    least = np.sqrt(np.maximum(radii**2 - above**2, 0.0)) / _REACH - slack
    near = (distance < _REACH * radii + slack) & (distance > least)
    first, second = first[near], second[near]
    keys = (beads.ids[first] << _SHIFT) | beads.ids[second]
    order = np.argsort(keys)
    return keys[order], first[order], second[order]


def _new_rows(
    time: float,
    beads: Beads,
    keys: NDArray[np.int64],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
) -> NDArray[np.void]:
    rows = np.zeros(keys.size, dtype=_ROW)
    rows['key'] = keys
    rows['tolerance'] = _TOLERANCE * np.hypot(beads.errors[first], beads.errors[second])
    rows['last'] = time
    rows['speed'] = np.sqrt(beads.variances[first] + beads.variances[second])
    everything = np.ones(keys.size, dtype=np.bool_)
    _restart(rows, everything, beads.places[second] - beads.places[first], time)
    return rows


def _restart(
    rows: NDArray[np.void],
    which: NDArray[np.bool_],
    apart: NDArray[np.float64],
    time: float,
) -> None:
    for name in ('smooth', 'low', 'high', 'offset'):
        rows[name][which] = apart[which]
    rows['way'][which] = 0.0
    rows['start'][which] = time
    rows['stayed'][which] = time


def _settled(
    rows: NDArray[np.void],
    stays: NDArray[np.bool_],
    apart: NDArray[np.float64],
    time: float,
) -> NDArray[np.bool_]:
    """Bodies whose beads are apart as they were not before, and stay so: a track has jumped."""
    _begin(rows, rows['bonded'] & stays, rows['smooth'], time)
    moved = (rows['high'] - rows['low'] > 2.0 * rows['tolerance'][:, None]).any(axis=1)
    _begin(rows, rows['bonded'] & moved, apart, time)
    settled = rows['bonded'] & ~stays & (time - rows['start'] >= _STEADY)
    rows['offset'][settled] = rows['smooth'][settled]
    return np.asarray(settled)


def _begin(
    rows: NDArray[np.void],
    which: NDArray[np.bool_],
    apart: NDArray[np.float64],
    time: float,
) -> None:
    """Follow how far a separation goes from now on."""
    for name in ('smooth', 'low', 'high'):
        rows[name][which] = apart[which]
    rows['start'][which] = time


def _parts(keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return keys >> _SHIFT, keys & ((1 << _SHIFT) - 1)


def _ids(key: int) -> tuple[int, int]:
    return int(key) >> _SHIFT, int(key) & ((1 << _SHIFT) - 1)
