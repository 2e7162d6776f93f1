"""Bodies from tracks: bonds between beads, merges and the number of bodies."""

from __future__ import annotations

from collections import Counter, deque
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.sticking.chance_proximity import (
    CollisionRate,
    encounter_rate,
    max_chance_probability,
    parting_rate,
    parting_share,
)
from nanorocks_ros.records import BodyEstimate, Merge, Tracks
from nanorocks_ros.stages.bodies.body_sizes import (
    bodies_of,
    joined_bodies,
    possible_merges,
    size_statistics,
)
from nanorocks_ros.stages.bodies.bonds import Bond, BondFinder
from nanorocks_ros.stages.bodies.comoving_bodies import ComovingBodies
from nanorocks_ros.stages.bodies.frame_history import BodyFrame, FrameHistory
from nanorocks_ros.stages.bodies.local_temperature import select_seen, update_energies
from nanorocks_ros.stages.bodies.new_tracks import NewTracks
from nanorocks_ros.stages.bodies.occluded_beads import OccludedBeads
from nanorocks_ros.stages.bodies.reappearing_beads import ReappearingBeads
from nanorocks_ros.stages.bodies.touching_pairs import SeenBeads
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

_NS = 1e9
# Largest probability of free beads over that of a merge, once merges were seen; and the number of
# merges assumed before the first one.
_MERGE_CHANCE_SHARE = 0.1
_PRIOR_MERGES = 0.5
# The same for bodies that do not visibly touch, over that of beads that do.
_COMOVING_CHANCE_SHARE = 0.3
# Shortest mean duration of a track, [s]; below, bonds cannot be told from broken tracks. In films
# without sticking it is 7 to 100 s in trays 1, 3 and 5, without a false bond from a double
# detection, and 1 to 3 s in tray 4.
_MAX_TRACK_BREAK_TIME = 5.0


class BodyCounter(RestartingStage[Tracks, BodyEstimate | Merge]):
    """Counts the bodies of one tray.

    Tracks give the new merges and the estimates that are due. A new cycle starts with single
    beads. Nothing is counted in a tray with grains.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Raises
    ------
    ConfigurationError
        If the rate of false alarms is out of range.
    """

    clock = Tracks

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.bodies
        self._tray = tray
        self._max_chance = max_chance_probability(tray, self._settings.false_alarm_rate)
        self._encounter_rate = encounter_rate(tray)
        self._equal_sizes = np.array(
            [kind.diameter_low == kind.diameter_high for kind in tray.species]
        )
        # The outlines of grains differ with their orientation, by more than their places are said
        # to be uncertain: grains beside each other would look bonded.
        self._has_grains = any(kind.properties.shape == 'grain' for kind in tray.species)
        self._bond_finder = BondFinder(
            parting_rate(tray), CollisionRate(tray), parting_share(tray)
        )
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        """Forget all tracks and bodies; estimates that are held back are lost."""
        del stamp_ns
        self._first_ns = 0
        self._new_tracks = NewTracks()
        self._start_cycle(0)

    def _start_cycle(self, cycle: int) -> None:
        self._cycle = cycle
        self._new_tracks.next_cycle()
        self._bond_finder.clear()
        self._occluded = OccludedBeads()
        self._reappearing = ReappearingBeads()
        self._comoving = ComovingBodies(parting_rate(self._tray))
        self._bonds: dict[tuple[int, int], Bond] = {}
        self._possible_doubles: list[Bond] = []
        self._n_joins = 0
        self._first_merge: int | None = None
        # Numbers of the beads with tracks, of the occluded ones, and of both.
        no_beads = frozenset[int]()
        self._known_beads = np.empty(0, dtype=np.int64), no_beads, no_beads
        self._frames = FrameHistory()
        self._held_back: deque[BodyFrame] = deque()
        self._next_due_ns: int | None = None
        self._path = 0.0
        self._energies = np.zeros(len(self._tray.species))

    def _process(self, record: Tracks) -> tuple[BodyEstimate | Merge, ...]:
        """Add the tracks of a frame; return new merges and the estimates that are due."""
        if self._has_grains:
            return ()
        estimates: tuple[BodyEstimate | Merge, ...] = ()
        if record.cycle != self._cycle:
            estimates = self.flush()
            self._start_cycle(record.cycle)
        if not self._frames:
            self._first_ns = record.stamp_ns
        time = (record.stamp_ns - self._first_ns) / _NS
        ids = self._occluded.assign_ids(record, self._bonds)
        self._new_tracks.push(record, ids)
        beads = self._seen_beads(record, ids)
        self._add_frame(time, record, beads, ids)
        bonds, broken = self._bond_finder.push(time, beads, self._max_free_chance())
        for ids_of in broken:
            self._bonds.pop(ids_of, None)
        bonds += self._comoving_bonds(time, record, beads)
        due = self._due_estimates(record.stamp_ns)
        if self._tracks_break_often():
            return estimates
        bonds = self._without_doubles(bonds)
        odds = self._merges_per_encounter(len(bonds))
        merges = [self._merge(_since_met(bond, odds), record.stamp_ns) for bond in bonds]
        return (*estimates, *merges, *due)

    def _comoving_bonds(self, time: float, tracks: Tracks, beads: SeenBeads) -> list[Bond]:
        """Bonds between bodies that move together; at least one body has several beads."""
        if self._first_merge is None or not self._comoving.due(time):
            return []
        frame = self._frames.last
        body_of = bodies_of(frame.known_ids, [*self._bonds, *frame.attached])
        sizes = Counter(body_of.values())
        # Equipartition: free bodies have the same mean energy, whatever their size.
        mean_size = len(body_of) / len(sizes)
        own_sizes = np.array([sizes[body_of[bead]] for bead in beads.ids.tolist()])
        variances = (self._energies[tracks.species] / tracks.radii**3)[self._rows]
        body_beads = beads._replace(variances=variances * mean_size / own_sizes)
        hidden = beads.ids.size < self._tray.count
        bonds = self._comoving.push(
            time, body_beads, body_of, hidden, _COMOVING_CHANCE_SHARE * self._max_free_chance()
        )
        self._bond_finder.add_bonds(time, beads, bonds)
        return bonds

    def _without_doubles(self, bonds: list[Bond]) -> list[Bond]:
        """Hold back bonds that may be double detections of one bead, until another bond is found.

        Once beads stick, a track that begins on top of another is more likely a bead that its
        cluster had hidden.
        """
        certain = [bond for bond in bonds if not self._new_tracks.is_double_detection(bond.ids)]
        self._possible_doubles += [
            bond for bond in bonds if self._new_tracks.is_double_detection(bond.ids)
        ]
        if not certain and self._first_merge is None:
            return []
        accepted, self._possible_doubles = [*certain, *self._possible_doubles], []
        return accepted

    def flush(self) -> tuple[BodyEstimate, ...]:
        """Give out the estimates that are held back, at the end of a cycle or a recording.

        An estimate is held back for `bodies.delay`, so that merges found in that time count in
        it. Here only merges found so far count. Merges are not held back: `push` returns each
        when it is found. Nothing is given out while tracks end too often for bonds to be found.
        Counting goes on with the next frame.
        """
        frames, self._held_back = list(self._held_back), deque()
        return (
            () if self._tracks_break_often() else tuple(self._estimate(frame) for frame in frames)
        )

    def _tracks_break_often(self) -> bool:
        """Whether tracks end too often for bonds to be found.

        After the first merge the answer is no: tracks then end since beads occlude each other.
        """
        if self._first_merge is not None:
            return False
        time = self._frames.last.time if self._frames else 0.0
        return self._new_tracks.rate(time) * _MAX_TRACK_BREAK_TIME > self._tray.count

    def _seen_beads(self, tracks: Tracks, ids: NDArray[np.int64]) -> SeenBeads:
        self._update_energies(tracks)
        self._rows, seen, positions, errors, radii, radius_errors, variances = select_seen(
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
            self._equal_sizes,
        )
        height = self._tray.dimensions[2]
        return SeenBeads(seen, positions, errors, radii, radius_errors, variances, height)

    def _update_energies(self, tracks: Tracks) -> None:
        """Update the mean energy of each species and the mean path of a bead.

        Energies, not speeds: in a species of many sizes the large beads are slow and look bonded.
        """
        speed = update_energies(
            tracks.velocities,
            tracks.velocity_errors,
            tracks.radii,
            tracks.species,
            tracks.seen,
            self._energies,
        )
        if self._frames:
            self._path += speed * ((tracks.stamp_ns - self._frames.last.stamp_ns) / _NS)

    def _add_frame(
        self, time: float, tracks: Tracks, beads: SeenBeads, ids: NDArray[np.int64]
    ) -> None:
        # Most frames have the same beads as the one before.
        if ids is not self._known_beads[0] or self._occluded.hidden != self._known_beads[1]:
            hidden = self._occluded.hidden
            self._known_beads = ids, hidden, frozenset(ids.tolist()) | hidden
        known_ids = self._known_beads[2]
        members = {bead for pair in self._bonds for bead in pair}
        attached = self._reappearing.push(tracks, ids, members)
        frame = BodyFrame(
            time, tracks.stamp_ns, beads.ids, beads.positions, beads.radii, known_ids, attached
        )
        self._frames.push(frame)
        if self._next_due_ns is None or tracks.stamp_ns >= self._next_due_ns:
            self._next_due_ns = tracks.stamp_ns + round(self._settings.interval * _NS)
            self._held_back.append(frame)

    def _merges_per_encounter(self, new_bonds: int = 0) -> float:
        """Merges per encounter in this cycle so far, with new ones."""
        met = 0.5 * self._tray.count * self._encounter_rate * self._path
        return (len(self._bonds) + new_bonds + _PRIOR_MERGES) / max(met, 1.0)

    def _max_free_chance(self) -> float:
        """Probability of free beads below which a pair is a bond.

        Once beads stick, it is compared with the probability of a merge per encounter.
        """
        if not self._bonds:
            return self._max_chance
        return max(self._max_chance, _MERGE_CHANCE_SHARE * self._merges_per_encounter())

    def _merge(self, bond: Bond, known_ns: int) -> Merge:
        start = self._start_of(bond)
        self._bonds[bond.ids] = bond._replace(start=start)
        joins = self._max_bodies() < self._tray.count - self._n_joins
        self._n_joins += joins
        stamp_ns = self._first_ns + round(start * _NS)
        if self._first_merge is None or stamp_ns < self._first_merge:
            self._first_merge = stamp_ns
        return Merge(
            stamp_ns=stamp_ns,
            known_ns=known_ns,
            tray=self._tray.number,
            cycle=self._cycle,
            tracks=np.array(bond.ids, dtype=np.int32),
            joins=joins,
        )

    def _start_of(self, bond: Bond) -> float:
        """Time since which two bodies are one, [s]."""
        # Of larger bodies the two beads that were found need not be those that met.
        return self._frames.touching_since(
            self._frames.start_of(bond), partial(joined_bodies, bond, self._bonds.values())
        )

    def _max_bodies(self) -> int:
        """Largest number of bodies now: unknown beads count as single ones."""
        frame = self._frames.last
        body_of = bodies_of(frame.known_ids, [*self._bonds, *frame.attached])
        return len(set(body_of.values())) + max(self._tray.count - len(body_of), 0)

    def _due_estimates(self, stamp_ns: int) -> tuple[BodyEstimate, ...]:
        estimates = []
        delay_ns = round(self._settings.delay * _NS)
        while self._held_back and stamp_ns - self._held_back[0].stamp_ns >= delay_ns:
            estimates.append(self._estimate(self._held_back.popleft()))
        return tuple(estimates)

    def _estimate(self, frame: BodyFrame) -> BodyEstimate:
        bonds = [ids for ids, bond in self._bonds.items() if bond.start <= frame.time]
        body_of = bodies_of(frame.known_ids, [*bonds, *frame.attached])
        sizes = Counter(body_of.values())
        first = self._first_merge
        statistics = size_statistics(
            np.array(list(sizes.values()), dtype=np.int64),
            self._tray.count,
            possible_merges(
                body_of, *self._bond_finder.unconfirmed(), self._merges_per_encounter()
            ),
        )
        return BodyEstimate(
            stamp_ns=frame.stamp_ns,
            tray=self._tray.number,
            cycle=self._cycle,
            beads=self._tray.count,
            followed=len(frame.known_ids),
            first_merge_ns=first if first is not None and first <= frame.stamp_ns else None,
            bodies=statistics.bodies,
            mean_size=statistics.mean_size,
            weighted_size=statistics.weighted_size,
            clustered_share=statistics.clustered_share,
            clusters=statistics.clusters,
            sizes=statistics.counts,
        )


def _since_met(bond: Bond, odds: float) -> Bond:
    """The bond, dated to when its beads met if they have more probably stuck since then.

    They may have turned, and kept their separation only later.

    Parameters
    ----------
    bond : Bond
    odds : float
        Merges per encounter.
    """
    return bond._replace(start=min(bond.start, bond.met)) if bond.met_chance < odds else bond
