"""From tracks to bodies: which beads stick together, since when, and how many bodies there are."""

from __future__ import annotations

from collections import Counter, deque
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.inference.sticking.chance_proximity import (
    chance,
    encounter_rate,
    largest_chance,
)
from nanorocks_ros.records import BodyEstimate, Merge
from nanorocks_ros.stages.bodies.body_sizes import bodies_of, size_fields
from nanorocks_ros.stages.bodies.bond_kernels import Beads
from nanorocks_ros.stages.bodies.bonds import Bond, Pairs
from nanorocks_ros.stages.bodies.comoving_bodies import Companions
from nanorocks_ros.stages.bodies.local_temperature import learn_energies, of_seen
from nanorocks_ros.stages.bodies.new_tracks import Births
from nanorocks_ros.stages.bodies.occluded_beads import Ghosts
from nanorocks_ros.stages.bodies.reappearing_beads import Clinging

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks
    from nanorocks_ros.settings import PipelineSettings

_NS = 1e9
# Pictures over this time are kept, to find when beads began to stay beside each other, [s].
_LOOK_BACK = 10.0
# How much more probable than chance a merge must be where others were seen; and merges assumed
# before the first.
_BELIEVED = 0.1
_UNSEEN_MERGES = 0.5
# Bodies that touch nowhere in sight are believed to be one when that is so much less by chance.
_SURER = 0.3
# Tracks break off this often at most, of each bead on average, [s]: where they break more often,
# nobody can tell who stays beside whom. Of films without sticking 7 to 100 s in trays 1, 3 and 5,
# where none of what stays together is one bead found twice; 1 to 3 s in trays 4 and 7.
_HELD_TOGETHER = 5.0


class _Picture(NamedTuple):
    """One of the last pictures: beads seen, all that are known to be there, who clings to whom."""

    time: float
    stamp_ns: int
    ids: NDArray[np.int64]
    places: NDArray[np.float64]
    known: frozenset[int]
    clinging: tuple[tuple[int, int], ...]


class BodyCounter:
    """Counts the bodies of one tray.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Raises
    ------
    ConfigurationError
        For a rate of false alarms that is none.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.bodies
        self._tray = tray
        self._largest = largest_chance(tray, self._settings.false_alarms)
        self._rate = encounter_rate(tray)
        self._alike = np.array([one.diameter_low == one.diameter_high for one in tray.species])
        self._pairs = Pairs(partial(chance, rate=self._rate))
        self.reset()

    def reset(self) -> None:
        """Forget all tracks and bodies; estimates that are held back are lost."""
        self._first_ns = 0
        self._last_ns: int | None = None
        self._births = Births()
        self._start_cycle(0)

    def _start_cycle(self, cycle: int) -> None:
        self._cycle = cycle
        self._births.next_cycle()
        self._pairs.clear()
        self._ghosts = Ghosts()
        self._clinging = Clinging()
        self._companions = Companions(self._rate)
        self._bonds: dict[tuple[int, int], Bond] = {}
        self._doubted: list[Bond] = []
        self._joins = 0
        self._first_merge: int | None = None
        # Numbers of beads that are seen, those that are hidden, and all of them.
        none = frozenset[int]()
        self._present = np.empty(0, dtype=np.int64), none, none
        self._pictures: deque[_Picture] = deque()
        self._waiting: deque[_Picture] = deque()
        self._due_ns: int | None = None
        self._way = 0.0
        self._energies = np.zeros(len(self._tray.species))

    def push(self, tracks: Tracks, cycle: int = 0) -> tuple[BodyEstimate | Merge, ...]:
        """Take the next picture: merges that became known, and a count when one is due.

        Parameters
        ----------
        tracks : Tracks
        cycle : int
            Shaking events so far: another one sets all beads apart. A stamp that goes back
            starts all afresh.
        """
        if self._last_ns is not None and tracks.stamp_ns <= self._last_ns:
            self.reset()
        found: tuple[BodyEstimate | Merge, ...] = ()
        if cycle != self._cycle:
            found = self.flush()
            self._start_cycle(cycle)
        if not self._pictures:
            self._first_ns = tracks.stamp_ns
        self._last_ns = tracks.stamp_ns
        time = (tracks.stamp_ns - self._first_ns) / _NS
        ids = self._ghosts.named(tracks, self._bonds)
        self._births.push(tracks, ids)
        beads = self._beads(tracks, ids)
        self._keep(time, tracks, beads, ids)
        bonds, broken = self._pairs.push(time, beads, self._allowed())
        for ids_of in broken:
            self._bonds.pop(ids_of, None)
        bonds += self._as_one(time, tracks, beads)
        due = self._due(tracks.stamp_ns)
        if self._unclear():
            return found
        merges = [self._merge(bond, tracks.stamp_ns) for bond in self._believed(bonds)]
        return (*found, *merges, *due)

    def _as_one(self, time: float, tracks: Tracks, beads: Beads) -> list[Bond]:
        """Bodies that move as one. Of two single beads only their own separation tells."""
        if self._first_merge is None or not self._companions.due(time):
            return []
        picture = self._pictures[-1]
        body = bodies_of(picture.known, [*self._bonds, *picture.clinging])
        sizes = Counter(body.values())
        # All bodies have the same energy on average, and each bead its share of the whole.
        mean = len(body) / len(sizes)
        own = np.array([sizes[body[one]] for one in beads.ids.tolist()])
        usual = (self._energies[tracks.species] / tracks.radii**3)[self._rows]
        free = beads._replace(variances=usual * mean / own)
        hidden = beads.ids.size < self._tray.count
        bonds = self._companions.push(time, free, body, hidden, _SURER * self._allowed())
        self._pairs.adopt(time, beads, bonds)
        return bonds

    def _believed(self, bonds: list[Bond]) -> list[Bond]:
        """Those that are two beads: one of a pair that appeared over the other may be the same.

        Once others are known to stick it is rather one that was hidden by its cluster.
        """
        sure = [bond for bond in bonds if not self._births.one_bead(bond.ids)]
        self._doubted += [bond for bond in bonds if self._births.one_bead(bond.ids)]
        if not sure and self._first_merge is None:
            return []
        believed, self._doubted = [*sure, *self._doubted], []
        return believed

    def flush(self) -> tuple[BodyEstimate, ...]:
        """Give out the estimates that are held back, at the end of a cycle or a recording.

        An estimate is held back for `bodies.delay`, so that merges found in that time count in
        it. Here the merges found so far are all. Merges are not held back: `push` returns each
        when it is found. Nothing is given out while tracks break off too often for bodies to be
        told. Counting goes on with the next frame.
        """
        left, self._waiting = list(self._waiting), deque()
        return () if self._unclear() else tuple(self._count(picture) for picture in left)

    def _unclear(self) -> bool:
        """Whether tracks break off so often that nobody can tell who stays beside whom.

        Once beads are known to stick, tracks break since they hide each other.
        """
        if self._first_merge is not None:
            return False
        time = self._pictures[-1].time if self._pictures else 0.0
        return self._births.rate(time) * _HELD_TOGETHER > self._tray.count

    def _beads(self, tracks: Tracks, ids: NDArray[np.int64]) -> Beads:
        self._learn(tracks)
        self._rows, seen, places, errors, radii, radius_errors, usual = of_seen(
            self._energies,
            ids,
            tracks.positions,
            tracks.position_errors,
            tracks.velocities,
            tracks.velocity_errors,
            tracks.radii,
            tracks.radius_errors,
            tracks.species,
            tracks.seen,
            self._alike,
        )
        height = self._tray.dimensions[2]
        return Beads(seen, places, errors, radii, radius_errors, usual, height)

    def _learn(self, tracks: Tracks) -> None:
        """Follow the energy of a component of the motion of each species.

        Of a species of many sizes the large ones are slow: two of them seem to stay together.
        """
        speed = learn_energies(
            tracks.velocities,
            tracks.velocity_errors,
            tracks.radii,
            tracks.species,
            tracks.seen,
            self._energies,
        )
        if self._pictures:
            self._way += speed * ((tracks.stamp_ns - self._pictures[-1].stamp_ns) / _NS)

    def _keep(self, time: float, tracks: Tracks, beads: Beads, ids: NDArray[np.int64]) -> None:
        # In most pictures there are the same as in the one before.
        if ids is not self._present[0] or self._ghosts.hidden != self._present[1]:
            hidden = self._ghosts.hidden
            self._present = ids, hidden, frozenset(ids.tolist()) | hidden
        known = self._present[2]
        members = {one for pair in self._bonds for one in pair}
        clinging = self._clinging.push(tracks, ids, members)
        picture = _Picture(time, tracks.stamp_ns, beads.ids, beads.places, known, clinging)
        self._pictures.append(picture)
        while time - self._pictures[0].time > _LOOK_BACK:
            self._pictures.popleft()
        if self._due_ns is None or tracks.stamp_ns >= self._due_ns:
            self._due_ns = tracks.stamp_ns + round(self._settings.interval * _NS)
            self._waiting.append(picture)

    def _odds(self) -> float:
        """Merges per encounter, as of this cycle so far."""
        met = 0.5 * self._tray.count * self._rate * self._way
        return (len(self._bonds) + _UNSEEN_MERGES) / max(met, 1.0)

    def _allowed(self) -> float:
        """The chance of free beads below which they are a body.

        Where beads are known to stick others do, too: then the more probable is believed.
        """
        return self._largest if not self._bonds else max(self._largest, _BELIEVED * self._odds())

    def _merge(self, bond: Bond, known_ns: int) -> Merge:
        start = self._since(bond)
        self._bonds[bond.ids] = bond._replace(start=start)
        fewer = self._free() < self._tray.count - self._joins
        self._joins += fewer
        stamp_ns = self._first_ns + round(start * _NS)
        if self._first_merge is None or stamp_ns < self._first_merge:
            self._first_merge = stamp_ns
        return Merge(
            stamp_ns=stamp_ns,
            known_ns=known_ns,
            tray=self._tray.number,
            cycle=self._cycle,
            tracks=np.array(bond.ids, dtype=np.int32),
            joins=fewer,
        )

    def _free(self) -> int:
        """Bodies now, at most: beads that nobody knows of are free."""
        picture = self._pictures[-1]
        body = bodies_of(picture.known, [*self._bonds, *picture.clinging])
        return len(set(body.values())) + max(self._tray.count - len(body), 0)

    def _since(self, bond: Bond) -> float:
        """Since when the separation has been what it is now: a jump in a track is no beginning."""
        start, misses = bond.start, 0
        for picture in reversed(self._pictures):
            if picture.time >= bond.start:
                continue
            rows = np.searchsorted(picture.ids, bond.ids)
            if rows.max() >= picture.ids.size or (picture.ids[rows] != bond.ids).any():
                misses += 1
            else:
                apart = picture.places[rows[1]] - picture.places[rows[0]]
                if np.abs(apart - bond.offset).max() < bond.tolerance:
                    start, misses = picture.time, 0
                else:
                    misses += 1
            if misses > 2:
                break
        return start

    def _due(self, stamp_ns: int) -> tuple[BodyEstimate, ...]:
        estimates = []
        delay_ns = round(self._settings.delay * _NS)
        while self._waiting and stamp_ns - self._waiting[0].stamp_ns >= delay_ns:
            estimates.append(self._count(self._waiting.popleft()))
        return tuple(estimates)

    def _count(self, picture: _Picture) -> BodyEstimate:
        bonds = [ids for ids, bond in self._bonds.items() if bond.start <= picture.time]
        body = bodies_of(picture.known, [*bonds, *picture.clinging])
        sizes = Counter(body.values())
        first = self._first_merge
        return BodyEstimate(
            stamp_ns=picture.stamp_ns,
            tray=self._tray.number,
            cycle=self._cycle,
            beads=self._tray.count,
            followed=len(picture.known),
            first_merge_ns=first if first is not None and first <= picture.stamp_ns else None,
            **size_fields(
                np.array(list(sizes.values()), dtype=np.int64),
                self._tray.count,
                self._possible(body, sizes),
            ),
        )

    def _possible(self, body: dict[int, int], sizes: Counter[int]) -> list[tuple[int, int, float]]:
        """Bodies that may have joined: free pairs look as theirs by chance, and merges happen.

        As often, by encounters, as they did so far in this cycle.
        """
        odds = self._odds()
        pairs, chances = self._pairs.pending()
        found: dict[tuple[int, int], float] = {}
        for (first, second), one in zip(pairs.tolist(), chances.tolist(), strict=True):
            if first in body and second in body and body[first] != body[second]:
                key = min(body[first], body[second]), max(body[first], body[second])
                found[key] = max(found.get(key, 0.0), odds / (odds + one))
        return [(sizes[a], sizes[b], one) for (a, b), one in found.items()]
