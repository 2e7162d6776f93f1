"""Rebounds from side walls of bodies of several beads that turn."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import NS, Measured, Merge, Rebound, Tracks
from nanorocks_ros.stages.bodies.body_sizes import bodies_of
from nanorocks_ros.stages.contacts.pair_tests import MIN_SIGNAL
from nanorocks_ros.stages.contacts.rigid_bodies.rigid_rebound import (
    BodyFrames,
    RigidRebound,
    rigid_rebound,
)
from nanorocks_ros.stages.flights.relative_drag import relative_drag
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# A contact is looked at that long after it, [ns]: of bodies those count that are known by then.
_DELAY_NS = 3 * NS // 2
# Frames on each side of a contact, longer and longer: a fit to more is kept while it holds.
_SPANS = (5, 7, 10, 14)
# Largest excess of chi square, in standard deviations, half that of free beads: a hit of floor or
# lid beside the contact turns a body, and shows little in its projection.
_MAX_EXCESS = 2.0
# What hits of floor or lid that show in no misfit add to the error of the ratio of both speeds: in
# an independent gas ratios of 98 rebounds of 15 beads, known to 0.02 or better, scattered by that.
_UNNOTICED = 0.04
# Fewest frames in which each bead of a body is seen before, and after, a contact.
_FEWEST_SEEN = 4
# Beads of the largest body that is fitted.
_MOST_BEADS = 20
# Tolerance of the distance of a bead to the wall at a contact, in radii.
_WALL_TOLERANCE = 0.15
# Rebounds of a body from a wall closer to each other than this are fits to one, [ns].
_SAME_NS = 100_000_000
# Least spread of the heights of beads, [m].
_LEAST_SPREAD = 1e-4
# Largest deviation of the displacements of the tray from a line, in errors of positions: a tray
# that swings passes its motion to what rebounds.
_MAX_SWING = 1.0


class _Contact(NamedTuple):
    """A bead of a body nearest to a wall.

    Parameters
    ----------
    row : int
        Of the frame.
    wall : int
        As of `Rebound`.
    bead : int
        Track.
    body : tuple of int
        Tracks of all beads of the body.
    """

    row: int
    wall: int
    bead: int
    body: tuple[int, ...]


class BodyRebounds(RestartingStage[Tracks | Merge, Rebound]):
    """Finds rebounds of bodies in the tracks of one tray, where the merges are known.

    They come 1.5 s after the contact. The body must not change within the frames of a fit.

    Parameters
    ----------
    tray : Tray

    Attributes
    ----------
    noise : ndarray (species,)
        Variance of positions about free flights over that by their errors, as `ContactFinder`
        learns it.
    """

    clock = Tracks

    def __init__(self, tray: Tray) -> None:
        self._tray = tray
        self.noise = np.ones(len(tray.species))
        self._densities = np.array([kind.density for kind in tray.species])
        diameter = float(np.mean([kind.diameter for kind in tray.species]))
        self._spread = max(0.5 * (tray.dimensions[2] - diameter), _LEAST_SPREAD)
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        self._frames: deque[Tracks] = deque()
        self._merges: list[Merge] = []
        self._cycle = 0
        # Frames up to then were looked at.
        self._seen_ns = -1
        # Of each wall and body the last rebound, [ns].
        self._last: dict[tuple[int, tuple[int, ...]], int] = {}

    def _process(self, record: Tracks | Merge) -> tuple[Rebound, ...]:
        if isinstance(record, Merge):
            self._merges.append(record)
            return ()
        rebounds: tuple[Rebound, ...] = ()
        if record.cycle != self._cycle:
            # The shaking separates all bodies.
            rebounds = self.flush()
            merges = [merge for merge in self._merges if merge.cycle == record.cycle]
            self._restart()
            self._cycle, self._merges = record.cycle, merges
        self._frames.append(record)
        while record.stamp_ns - self._frames[0].stamp_ns > 2 * _DELAY_NS:
            self._frames.popleft()
        return (*rebounds, *self._rebounds_until(record.stamp_ns - _DELAY_NS))

    def flush(self) -> tuple[Rebound, ...]:
        """Give out the rebounds that are held back, at the end of a cycle or a recording."""
        return self._rebounds_until(self._frames[-1].stamp_ns) if self._frames else ()

    def _rebounds_until(self, last_ns: int) -> tuple[Rebound, ...]:
        """Rebounds in the frames up to a stamp that were not looked at yet."""
        first_ns, self._seen_ns = self._seen_ns, last_ns
        if not self._merges:
            return ()
        rows = [
            row for row, frame in enumerate(self._frames) if first_ns < frame.stamp_ns <= last_ns
        ]
        rebounds = (self._rebound(contact) for row in rows for contact in self._contacts_at(row))
        return tuple(rebound for rebound in rebounds if rebound is not None)

    def _contacts_at(self, row: int) -> list[_Contact]:
        """Beads of bodies that are nearest to a wall in a frame: one for each wall and body."""
        if row < min(_SPANS) or row + min(_SPANS) >= len(self._frames):
            return []
        before, frame, after = (self._frames[row + step] for step in (-1, 0, 1))
        bodies = self._bodies(frame)
        if not bodies or not all(
            np.array_equal(frame.ids, other.ids) for other in (before, after)
        ):
            return []
        contacts: dict[tuple[int, tuple[int, ...]], tuple[float, _Contact]] = {}
        for wall in range(4):
            gaps, last, following = (self._gaps(each, wall) for each in (frame, before, after))
            nearest = (gaps < _WALL_TOLERANCE) & (gaps <= last) & (gaps < following) & frame.seen
            for bead in np.flatnonzero(nearest).tolist():
                track = int(frame.ids[bead])
                body = bodies.get(track)
                if body is None:
                    continue
                contact = float(gaps[bead]), _Contact(row, wall, track, body)
                if (wall, body) not in contacts or contact[0] < contacts[wall, body][0]:
                    contacts[wall, body] = contact
        return [contact for _, contact in contacts.values()]

    def _gaps(self, tracks: Tracks, wall: int) -> NDArray[np.float64]:
        """Distances of the beads to a wall, in radii."""
        axis, high = divmod(wall, 2)
        places = tracks.positions[:, axis]
        distance = self._tray.dimensions[axis] - places if high else places
        return np.asarray(distance / tracks.radii - 1.0)

    def _bodies(self, frame: Tracks) -> dict[int, tuple[int, ...]]:
        """Of each track the tracks of its body, where the body may be fitted."""
        bonds = [
            (int(first), int(second))
            for first, second in (merge.tracks for merge in self._merges_until(frame.stamp_ns))
        ]
        members: dict[int, list[int]] = {}
        for bead, body in bodies_of({bead for bond in bonds for bead in bond}, bonds).items():
            members.setdefault(body, []).append(bead)
        return {
            bead: tuple(sorted(body))
            for body in members.values()
            if len(body) <= _MOST_BEADS
            for bead in body
        }

    def _merges_until(self, stamp_ns: int) -> list[Merge]:
        return [merge for merge in self._merges if merge.stamp_ns <= stamp_ns]

    def _changes(self, body: tuple[int, ...], first_ns: int, last_ns: int) -> bool:
        """Whether a bead of a body merged with another in a time."""
        beads = set(body)
        return any(
            first_ns <= merge.stamp_ns <= last_ns and not beads.isdisjoint(merge.tracks.tolist())
            for merge in self._merges
        )

    def _rebound(self, contact: _Contact) -> Rebound | None:
        """The rebound, by the longest span of frames to which a free rigid body fits."""
        row = contact.row
        frame = self._frames[row]
        last_ns = self._last.get((contact.wall, contact.body))
        if last_ns is not None and frame.stamp_ns - last_ns < _SAME_NS:
            return None
        best: RigidRebound | None = None
        best_span = 0
        sides: tuple[int, ...] = row, row + 1
        for span in _SPANS:
            fits = {first: self._fit(contact, first, span) for first in sides}
            good = {first: fit for first, fit in fits.items() if fit is not None}
            if not good:
                break
            side = min(good, key=lambda first: good[first].excess)
            best, best_span, sides = good[side], span, (side,)
        if best is None or not self._is_clear(best):
            return None
        self._last[contact.wall, contact.body] = frame.stamp_ns
        return self._record(contact, best, best_span)

    def _fit(self, contact: _Contact, first: int, span: int) -> RigidRebound | None:
        """A fit to so many frames before and after the contact; None where it does not hold."""
        rows = range(first - span, first + span)
        if rows.start < 0 or rows.stop > len(self._frames):
            return None
        frames = self._body_frames(contact, [self._frames[row] for row in rows])
        if frames is None:
            return None
        fit = rigid_rebound(frames, span)
        if fit is None or fit.excess > _MAX_EXCESS:
            return None
        # The contact lies between its frames, within an interval for its error.
        last, following = frames.times[span - 1 : span + 1].tolist()
        slack = 0.5 * (following - last)
        return fit if last - slack < fit.time < following + slack else None

    def _body_frames(self, contact: _Contact, tracks: list[Tracks]) -> BodyFrames | None:
        """The body in some frames; None where it changes, is hidden, or the tray swings."""
        if self._changes(contact.body, tracks[0].stamp_ns, tracks[-1].stamp_ns):
            return None
        rows = [_rows_of(contact.body, frame.ids) for frame in tracks]
        if any(row is None for row in rows):
            return None
        known = [(frame, row) for frame, row in zip(tracks, rows, strict=True) if row is not None]
        errors = np.array(
            [
                np.where(frame.seen[row], frame.position_errors[row], math.inf)
                for frame, row in known
            ]
        )
        half = len(tracks) // 2
        seen = np.isfinite(errors)
        if min(seen[:half].sum(axis=0).min(), seen[half:].sum(axis=0).min()) < _FEWEST_SEEN:
            return None
        frame, row = known[half]
        axis, high = divmod(contact.wall, 2)
        times = np.array([(each.stamp_ns - frame.stamp_ns) / NS for each in tracks])
        moves = np.array([each.displacement for each in tracks])
        if _swings(times, moves, float(np.median(errors[seen]))):
            return None
        radii = frame.radii[row]
        positions = np.array([each.positions[own] for each, own in known])
        return BodyFrames(
            times=times,
            positions=np.where(seen[:, :, np.newaxis], positions, 0.0),
            errors=errors,
            masses=self._densities[frame.species[row]] * 4.0 / 3.0 * math.pi * radii**3,
            radii=radii,
            bead=contact.body.index(contact.bead),
            axis=axis,
            outward=1.0 if high else -1.0,
            spread=self._spread,
            noise=float(self.noise[frame.species[row]].mean()),
        )

    def _is_clear(self, fit: RigidRebound) -> bool:
        return fit.incoming > MIN_SIGNAL * float(fit.errors[0]) and fit.outgoing > 0.0

    def _record(self, contact: _Contact, fit: RigidRebound, span: int) -> Rebound:
        frame = self._frames[contact.row]
        bead = int(np.flatnonzero(frame.ids == contact.bead)[0])
        species, radius = int(frame.species[bead]), float(frame.radii[bead])
        interval = (frame.stamp_ns - self._frames[contact.row - 1].stamp_ns) / NS
        drag_time = 0.5 * span * interval * relative_drag(self._tray, species, radius)
        unnoticed = _UNNOTICED * math.sqrt(0.5) * np.array([fit.incoming, fit.outgoing])
        incoming_error, outgoing_error = np.hypot(fit.errors, unnoticed).tolist()
        return Rebound(
            stamp_ns=frame.stamp_ns,
            tray=self._tray.number,
            cycle=self._cycle,
            track=contact.bead,
            species=species,
            wall=contact.wall,
            incoming=Measured(fit.incoming, incoming_error),
            outgoing=Measured(fit.outgoing, outgoing_error),
            tangential_incoming=fit.tangential,
            tangential_outgoing=fit.tangential,
            tangential_error=math.hypot(incoming_error, outgoing_error),
            wall_velocity=Measured(0.0, 0.0),
            place=fit.position,
            incoming_drag_time=drag_time,
            outgoing_drag_time=drag_time,
            free_height=max(self._tray.dimensions[2] - 2.0 * radius, 0.0),
            beads=len(contact.body),
        )


def _rows_of(tracks: tuple[int, ...], ids: NDArray[np.int32]) -> NDArray[np.int64] | None:
    """Where some tracks stand among others; None where one of them is missing."""
    places = {int(track): row for row, track in enumerate(ids.tolist())}
    rows = [places.get(track, -1) for track in tracks]
    return None if min(rows) < 0 else np.array(rows)


def _swings(times: NDArray[np.float64], moves: NDArray[np.float64], error: float) -> bool:
    """Whether a tray moves otherwise than on a straight line, by more than an error, [m]."""
    if not moves.any():
        return False
    terms = np.column_stack([np.ones_like(times), times])
    rest = moves - terms @ np.linalg.lstsq(terms, moves, rcond=None)[0]
    return bool(np.abs(rest).max() > _MAX_SWING * error)
