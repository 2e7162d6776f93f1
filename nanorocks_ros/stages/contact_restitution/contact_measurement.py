"""From the images of a tray to its contacts, where nothing but the beads is known.

What contacts are corrected for, acceleration and walls, is learnt from the tracks of the last
seconds, in which contacts are searched again and again: each is given out once.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import (
    NS,
    ContactOrFlight,
    FreeFlight,
    Measured,
    Notice,
    PairCollision,
    Quality,
    Rebound,
    SpeedEstimate,
    SpeedMethod,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.contact_restitution.track_contacts import ContactScene, contact_scene
from nanorocks_ros.stages.stage import RestartingStage
from nanorocks_ros.stages.tracking.tracker import Tracker

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Contact
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.stages.contact_restitution.track_contacts import TrackContacts

# Contacts are first searched after so long, and again as the tracks have grown by this part.
_FIRST_NS, _GROWTH = 3 * NS, 4 / 3
# Most places of beads in the tracks that are kept: with more, images would wait too long while
# acceleration and walls are learnt.
_MOST_PLACES, _MOST_FRAMES = 12_000, 4_000
# So many of the frames that are kept are searched with each image.
_SEARCHED_FRAMES = 8
# Contacts and flights that the summary is of, the last ones.
_MOST_CONTACTS = 2_000
# Times of one contact, found twice, differ by less, in intervals between frames.
_SAME_FRAMES = 2.0


class _Search:
    """A search for contacts in tracks, some frames at a time."""

    def __init__(self, scene: ContactScene, settings: PipelineSettings) -> None:
        self.scene = scene
        self.contacts: list[ContactOrFlight] = []
        self._finder = scene.finder(settings)
        self._next = 0

    def goes_on(self, frames: int, *, is_end: bool = False) -> bool:
        """Search the next frames; True when there are no more."""
        for record in self.scene.tracks[self._next : self._next + frames]:
            self.contacts += self._finder.push(record)
        self._next += frames
        if is_end:
            self.contacts += self._finder.flush()
        return self._next >= len(self.scene.tracks)


Measurement = SpeedEstimate | ContactOrFlight | Tracks | Notice


class ContactMeasurement(RestartingStage[TrayImage, Measurement]):
    """Measures contacts and speeds of one tray, in any state of motion.

    Speeds are the mean of the beads seen. An image whose stamp goes back starts all afresh.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
        Its height, numbers and densities may be unknown.
    container_known : bool
        As of `track_contacts`.

    Attributes
    ----------
    emit_mask : bool
        Of no effect: there is no mask.
    emit_tracks : bool
        Also emit the :class:`Tracks` of each image; off by default.
    """

    clock = TrayImage

    def __init__(self, settings: PipelineSettings, tray: Tray, *, container_known: bool) -> None:
        self._settings = settings
        self._tray = tray
        self._container_known = container_known
        self._interval_ns = round(settings.speed.interval * NS)
        used = {Rebound: settings.cooling.rebounds, PairCollision: settings.cooling.collisions}
        self._left_out = tuple(kind for kind, is_used in used.items() if not is_used)
        self.emit_mask = self.emit_tracks = False
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        self._tracker = Tracker(self._settings, self._tray)
        self._tracks: deque[Tracks] = deque()
        self._places = 0
        self._speeds: list[NDArray[np.float64]] = []
        self._speed_ns: int | None = None
        self._due_ns: int | None = None
        self._scene: ContactScene | None = None
        self._search: _Search | None = None
        self._given: dict[tuple[object, ...], list[int]] = defaultdict(list)
        self._known: deque[ContactOrFlight] = deque(maxlen=_MOST_CONTACTS)
        self._frames = 0
        self._ends = [math.nan, math.nan]
        self._highest = math.nan

    @property
    def contacts(self) -> int:
        """Contacts in the summary."""
        return sum(not isinstance(known, FreeFlight) for known in self._known)

    @property
    def ends(self) -> tuple[float, float]:
        """Mean speed in the first interval, and in the last one, [m/s]."""
        first, last = self._ends
        return first, last

    @property
    def highest(self) -> float:
        """The highest of these mean speeds, [m/s]."""
        return float(self._highest)

    def summary(self) -> TrackContacts:
        """What the contacts so far say."""
        scene = self._scene or contact_scene((), self._tray)
        return scene.summary(self._known, self._settings, frames=self._frames)

    def _process(self, record: TrayImage) -> tuple[Measurement, ...]:
        results: list[Measurement] = []
        for tracks in self._tracker.push(record):
            results += [tracks] if self.emit_tracks else []
            self._keep(tracks)
            results += self._speed(tracks)
            if self._due_ns is None:
                self._due_ns = tracks.stamp_ns + _FIRST_NS
            if self._search is None and tracks.stamp_ns >= self._due_ns:
                self._search = self._begun_search()
            if self._search is not None and self._search.goes_on(_SEARCHED_FRAMES):
                results += self._finished(self._search)
        return tuple(results)

    def flush(self) -> tuple[Measurement, ...]:
        """The contacts that are held back, those before unfinished flights included."""
        if not self._tracks:
            return ()
        search = self._begun_search()
        search.goes_on(len(self._tracks), is_end=True)
        return tuple(self._finished(search))

    def _keep(self, tracks: Tracks) -> None:
        self._tracks.append(tracks)
        self._places += tracks.ids.size
        self._frames += 1

    @property
    def _is_full(self) -> bool:
        return self._places > _MOST_PLACES or len(self._tracks) > _MOST_FRAMES

    def _begun_search(self) -> _Search:
        """A search in the tracks that are kept."""
        earlier = None if self._scene is None else self._scene.walls
        scene = contact_scene(
            list(self._tracks), self._tray, container_known=self._container_known, earlier=earlier
        )
        known = scene.acceleration
        if self._scene is not None and not known.is_seen and self._scene.acceleration.is_seen:
            # A ball that rolls at last does not fall any more.
            known = self._scene.acceleration
        self._scene = scene._replace(tracks=(), acceleration=known)
        return _Search(scene, self._settings)

    def _finished(self, search: _Search) -> list[ContactOrFlight]:
        """Contacts and flights of a search, but for those given out before."""
        new = self._not_given(search.contacts)
        self._search = None
        corner = np.array(search.scene.corner)
        self._known.extend(new)
        searched = search.scene.tracks
        first_ns, last_ns = searched[0].stamp_ns, searched[-1].stamp_ns
        self._due_ns = max(
            first_ns + round(_GROWTH * (last_ns - first_ns)),
            last_ns + round(self._settings.cooling.update_interval * NS),
        )
        if self._is_full:
            while len(self._tracks) > 2 and self._tracks[0].stamp_ns < (first_ns + last_ns) // 2:
                self._places -= self._tracks.popleft().ids.size
        return [_from_corner(result, corner) for result in new]

    def _not_given(self, contacts: Iterable[ContactOrFlight]) -> list[ContactOrFlight]:
        """Those that have not been given out, which are remembered."""
        interval_ns = np.median(np.diff([record.stamp_ns for record in self._tracks] or [0, 0]))
        new = []
        for result in sorted(contacts, key=lambda record: record.stamp_ns):
            if isinstance(result, self._left_out):
                continue
            if isinstance(result, FreeFlight):
                # A flight that goes on is found again, longer.
                apart_ns = result.duration * NS
            else:
                apart_ns = _SAME_FRAMES * float(interval_ns)
            stamps = self._given[_beads_of(result)]
            if all(abs(result.stamp_ns - stamp) > apart_ns for stamp in stamps):
                stamps.append(result.stamp_ns)
                new.append(result)
        self._forget()
        return new

    def _forget(self) -> None:
        """Forget what was given out before the tracks that are kept."""
        before = self._tracks[0].stamp_ns - _FIRST_NS
        for key in list(self._given):
            self._given[key] = [stamp for stamp in self._given[key] if stamp > before]
            if not self._given[key]:
                del self._given[key]

    def _speed(self, tracks: Tracks) -> Sequence[SpeedEstimate]:
        """Mean speed of the beads seen since the last one, once in an interval."""
        if self._speed_ns is None:
            self._speed_ns = tracks.stamp_ns
        known = tracks.seen & np.isfinite(tracks.velocities).all(axis=1)
        sizes = np.hypot(*tracks.velocities[known].T)
        self._speeds.append(np.stack([sizes, tracks.velocity_errors[known]]))
        window_ns = tracks.stamp_ns - self._speed_ns
        if window_ns < self._interval_ns:
            return ()
        speeds, errors = np.concatenate(self._speeds, axis=1)
        beads = max(speeds.size / len(self._speeds), 1.0)
        middle_ns = self._speed_ns + window_ns // 2
        self._speeds, self._speed_ns = [], tracks.stamp_ns
        if not speeds.size:
            return ()
        mean = float(speeds.mean())
        self._ends = [self._ends[0] if math.isfinite(self._ends[0]) else mean, mean]
        self._highest = np.fmax(self._highest, mean)
        # Velocities of a bead in neighbouring frames share their error.
        error = math.sqrt(float(np.mean(errors**2)) / beads)
        return (
            SpeedEstimate(
                stamp_ns=middle_ns,
                tray=self._tray.number,
                cycle=0,
                cycle_start_ns=None,
                mean_projected_speed=Measured(mean, error),
                window=window_ns / NS,
                method=SpeedMethod.TRACKING,
                quality=tracks.quality | Quality.UNCERTAIN,
            ),
        )


def _beads_of(result: ContactOrFlight) -> tuple[object, ...]:
    """What a contact or flight is of."""
    if isinstance(result, PairCollision):
        return PairCollision, *sorted(result.tracks.tolist())
    wall = result.wall if isinstance(result, Rebound) else None
    return type(result), result.track, wall


def _from_corner(result: ContactOrFlight, corner: NDArray[np.float64]) -> ContactOrFlight:
    """With the place from the corner of the tray."""
    if isinstance(result, FreeFlight):
        return result
    placed: Contact = replace(result, place=result.place + corner)
    return placed
