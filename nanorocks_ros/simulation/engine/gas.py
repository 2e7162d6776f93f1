"""A granular gas of hard spheres in a box: followed from event to event, exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine import checkpoint
from nanorocks_ros.simulation.engine.collision_rules import (
    CONTACT_DURATION,
    CollisionRules,
    for_species,
)
from nanorocks_ros.simulation.engine.event_loop import TAKEN, run_until, snapshot
from nanorocks_ros.simulation.engine.gas_state import (
    BODY,
    COUNTER,
    DONE,
    ELASTIC_PAIR,
    ELASTIC_WALL,
    EPOCH,
    FIX,
    FLAGS,
    LISTS_FULL,
    LOG_FULL,
    MERGE,
    MISSED,
    NOW,
    ORIGINAL,
    PAIR,
    PREDICTED,
    QUANTUM,
    RENEWED,
    SPECIES,
    STALE,
    WALL,
    new_state,
)
from nanorocks_ros.simulation.engine.input_checks import (
    check_beads,
    check_species,
    check_spins,
    check_times,
    overlapping_pair,
    refuse_overlap,
)
from nanorocks_ros.simulation.engine.neighbours.huge_pages import in_large_pages
from nanorocks_ros.simulation.engine.neighbours.list_tuning import (
    built,
    in_space_order,
    skin_for,
    with_lists,
)
from nanorocks_ros.simulation.engine.run_record import Course, Recorder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.collision_rules import Rules
    from nanorocks_ros.simulation.engine.gas_state import State

__all__ = ['CONTACT_DURATION', 'Beads', 'CollisionRules', 'EventCounts', 'HardSphereGas', 'Kernel']

# From so many beads on lists are faster (`python -m benchmarks engine`).
MOST_FOR_SCAN = 32

# Events between two looks at the keyboard and the watchdog: some tenths of a second.
_SLICE = 200_000
# The gas is stuck when this many slices move time by less than this part of the time in which
# beads cross the box some dozens of times.
_STUCK_SLICES = 10
_STUCK = 1e-9


class Kernel(IntEnum):
    """How the next event of a bead is found."""

    AUTOMATIC = 0
    SCAN = 1
    LISTS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Beads:
    """Beads at one instant.

    Parameters
    ----------
    radii, masses : ndarray (n,), [m], [kg], > 0
    positions, velocities : ndarray (n, 3), [m], [m/s]
    spins : ndarray (n, 3) or None, [rad/s]
        Angular velocities; None: no rotation.
    species : ndarray of int, (n,), or None
        From 0; None: all alike.
    """

    radii: NDArray[np.float64]
    masses: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64] | None = None
    species: NDArray[np.int32] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EventCounts:
    """How many events of each kind there were.

    Parameters
    ----------
    pair, wall, merge, fix : int
        Collisions of two beads, and of a bead with a wall; bodies that merged, and that stuck
        to a wall.
    elastic_pair, elastic_wall : int
        Collisions made elastic by the contact duration.
    stale, missed, renewed : int
        Events taken but void: the partner had moved on, or a graze rounded to a miss; lists
        renewed.
    """

    pair: int
    wall: int
    merge: int
    fix: int
    elastic_pair: int
    elastic_wall: int
    stale: int
    missed: int
    renewed: int


_PLACES = {
    'pair': PAIR,
    'wall': WALL,
    'merge': MERGE,
    'fix': FIX,
    'elastic_pair': ELASTIC_PAIR,
    'elastic_wall': ELASTIC_WALL,
    'stale': STALE,
    'missed': MISSED,
    'renewed': RENEWED,
}


class HardSphereGas:
    """Inelastic hard spheres in a box.

    Parameters
    ----------
    beads : Beads
        At time 0; inside the box, not overlapping.
    rules : CollisionRules
    kernel : Kernel
        Both give the same gas; automatic takes the faster.

    Raises
    ------
    SimulationError
        For beads that cannot be: NaN, no radius or mass, overlapping, larger than the box, of
        an unknown species; or lists asked for in a periodic box too small for them.
    """

    _state: State
    _rules: Rules
    _known_species: int
    _n_species: int

    def __init__(
        self, beads: Beads, rules: CollisionRules, kernel: Kernel = Kernel.AUTOMATIC
    ) -> None:
        self._rules = rules.compiled()
        self._known_species = rules.species
        self._set(beads, kernel)

    @classmethod
    def load(cls, path: Path) -> HardSphereGas:
        """A gas as it was saved; it goes on bit by bit as it would have.

        Raises
        ------
        SimulationError
            For a file that is damaged, or not a saved gas.
        """
        gas = cls.__new__(cls)
        state, gas._rules, gas._n_species = checkpoint.load(path)
        gas._state = in_large_pages(state)
        gas._known_species = gas._n_species
        return gas

    def save(self, path: Path) -> None:
        """Write the whole state to a file, which is replaced when it exists.

        Raises
        ------
        SimulationError
            When it cannot be written.
        """
        checkpoint.save(path, self._state, self._rules, self._n_species)

    @property
    def now(self) -> float:
        """How far the gas has been followed, [s]."""
        return float(self._state.clock[EPOCH] + self._state.clock[NOW])

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._by_number(self._state.rows[:, 7])

    @property
    def masses(self) -> NDArray[np.float64]:
        """Mass of each bead, (n,), [kg]."""
        return self._by_number(self._state.masses[:, 0])

    @property
    def bodies(self) -> NDArray[np.int32]:
        """The smallest number of a bead in the body of each bead, (n,)."""
        if not self._rules.sticky:
            return np.arange(self._state.rows.shape[0], dtype=np.int32)
        return self._by_number(self._state.bodies[:, BODY])

    @property
    def stuck(self) -> NDArray[np.bool_]:
        """Whether each bead is stuck to a wall, by itself or in a body, (n,)."""
        if not self._rules.sticky:
            return np.zeros(self._state.rows.shape[0], dtype=np.bool_)
        stuck: NDArray[np.bool_] = np.isinf(self._state.masses[self.bodies, 1])
        return stuck

    @property
    def kernel(self) -> Kernel:
        """The kernel at work."""
        return Kernel.LISTS if self._state.references.shape[0] else Kernel.SCAN

    @property
    def counts(self) -> EventCounts:
        """Events so far."""
        counts = self._state.counts.tolist()
        return EventCounts(**{name: counts[place] for name, place in _PLACES.items()})

    @property
    def books(self) -> NDArray[np.float64]:
        """Energy, momentum and angular momentum that left the beads, (18,), SI.

        Energy lost in pair collisions, at walls (gained from moving walls: negative) and in
        merges; normal momentum given to each of the six walls; momentum and angular momentum
        about the origin given to walls and to what sticks to them; angular momentum taken by
        aggregates, which cannot turn. Angular momentum is booked for rough and sticky beads.
        """
        return self._state.books.copy()

    @property
    def bytes_per_bead(self) -> float:
        """Memory in use for each bead."""
        return sum(array.nbytes for array in self._state) / self._state.rows.shape[0]

    def _by_number(self, values: NDArray[Any]) -> NDArray[Any]:
        ordered = np.empty_like(values)
        ordered[self._state.links[:, ORIGINAL]] = values
        return ordered

    def follow(
        self,
        end: float,
        frame_times: Sequence[float] | NDArray[np.float64] = (),
        observation_times: Sequence[float] | NDArray[np.float64] = (),
        *,
        log: bool = False,
        most_events: int | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Course:
        """Follow the gas to a time, and write down what is wanted on the way.

        Parameters
        ----------
        end : float, [s]
            Not before `now`.
        frame_times, observation_times : array_like, [s]
            Rising, from `now` to `end`; an event at the very time of a frame belongs to it.
        log : bool
            Whether to keep every event.
        most_events : int or None
            Events of any kind before giving up.
        progress : callable or None
            Called with the time reached, a few times a second.

        Raises
        ------
        SimulationError
            When times go backwards, after too many events, or when events follow one another
            so fast that time stands still. The gas can then still be followed further.
        """
        recorder = self._record(
            end,
            frame_times,
            observation_times,
            log=log,
            most_events=most_events,
            progress=progress,
        )
        return recorder.course()

    def _record(
        self,
        end: float,
        frame_times: Sequence[float] | NDArray[np.float64],
        observation_times: Sequence[float] | NDArray[np.float64],
        *,
        log: bool = False,
        most_events: int | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Recorder:
        now = self.now
        frames = check_times(now, end, frame_times)
        observed = check_times(now, end, observation_times, 'observation_times')
        recorder = Recorder(self._state, self._rules, frames, observed, self._n_species, log)
        slow = 0
        while True:
            before = self.now
            taken = int(recorder.output.done[TAKEN])
            part = taken + _SLICE if most_events is None else min(taken + _SLICE, most_events)
            status = run_until(self._state, self._rules, float(end), part, recorder.output)
            if status == DONE:
                return recorder
            if status == LISTS_FULL:
                self._state = built(self._state, self._rules)
                self._state.clock[PREDICTED] = 0.0
                continue
            if status == LOG_FULL:
                recorder.make_room()
                continue
            least = _STUCK * self._state.clock[QUANTUM]
            slow = slow + 1 if self.now - before < least else 0
            if part == most_events or slow == _STUCK_SLICES:
                raise SimulationError(
                    'event-driven engine',
                    f'{part} events taken and only {self.now:.6g} s of {end:.6g} s reached',
                    'raise most_events, the contact duration or the restitution',
                )
            if progress is not None:
                progress(self.now)

    def observe(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rows of sums over the beads at some times, as `observables` has them.

        Parameters
        ----------
        times : ndarray (n_times,), [s]
            At least one; the gas is followed to the last.

        Returns
        -------
        ndarray (n_times, n_columns)

        Raises
        ------
        SimulationError
            As `follow`.
        """
        return self._record(float(times[-1]), (), times).output.observations

    def run_until(
        self,
        end: float,
        frame_times: Sequence[float] | NDArray[np.float64] = (),
        most_events: int | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Follow the gas to a time; positions and velocities at the frame times.

        Parameters
        ----------
        end : float, [s]
        frame_times : array_like (n_frames,), [s]
        most_events : int or None

        Returns
        -------
        positions, velocities : ndarray (n_frames, n, 3), [m], [m/s]

        Raises
        ------
        SimulationError
            As `follow`.
        """
        course = self.follow(end, frame_times, most_events=most_events)
        return course.positions, course.velocities

    def beads(self) -> Beads:
        """The beads as they are now."""
        n = self._state.rows.shape[0]
        positions, velocities = np.empty((2, n, 3))
        spins = np.empty((n if self._rules.rough else 0, 3))
        snapshot(self._state, self._rules, positions, velocities, spins)
        return Beads(
            radii=self.radii,
            masses=self.masses,
            positions=positions,
            velocities=velocities,
            spins=spins if self._rules.rough else None,
            species=self._by_number(self._state.links[:, FLAGS] >> SPECIES),
        )

    def set_going(self, beads: Beads) -> None:
        """Go on with the same beads elsewhere or otherwise; time counts from 0 again.

        Bodies come apart. Events are counted on, and the random restitutions go on.

        Parameters
        ----------
        beads : Beads
            As many as before.

        Raises
        ------
        SimulationError
            For another number of beads, or beads that cannot be.
        """
        before = self._state
        n = before.rows.shape[0]
        if np.size(beads.radii) != n:
            raise SimulationError('beads', f'{np.size(beads.radii)} of them', f'give {n}')
        changes = self._by_number(before.links[:, COUNTER])
        self._set(beads, self.kernel)
        self._state.links[:, COUNTER] = changes[self._state.links[:, ORIGINAL]]
        self._state.counts[:] = before.counts
        self._state.books[:] = before.books

    def kick(self, velocities: NDArray[np.float64]) -> None:
        """Give every bead a new velocity where it is; time counts from 0 again.

        Parameters
        ----------
        velocities : ndarray (n, 3), [m/s]

        Raises
        ------
        SimulationError
            For velocities of another shape, or not finite.
        """
        self.set_going(replace(self.beads(), velocities=velocities, spins=None))

    def _set(self, beads: Beads, kernel: Kernel) -> None:
        checked = check_beads(
            beads.radii, beads.masses, beads.positions, beads.velocities, self._rules
        )
        n = checked[0].size
        species = check_species(beads.species, n, self._known_species)
        spins = check_spins(beads.spins, n, self._rules.rough)
        n_species = max(int(species.max()) + 1, self._known_species)
        rules = self._rules._replace(restitution=for_species(self._rules.restitution, n_species))
        state = _arranged(checked, species, spins, rules, kernel)
        refuse_overlap(*overlapping_pair(state, rules))
        self._state, self._rules, self._n_species = state, rules, n_species


def _arranged(
    checked: tuple[NDArray[np.float64], ...],
    species: NDArray[np.int32],
    spins: NDArray[np.float64],
    rules: Rules,
    kernel: Kernel,
) -> State:
    """The state for a kernel, beads in the order that suits it."""
    radii, masses, positions, velocities = checked
    skin = skin_for(radii, rules)
    if kernel == Kernel.LISTS and not skin:
        raise SimulationError(
            'kernel', 'the periodic box is too small for lists', 'use the scan, or a larger box'
        )
    listed = kernel == Kernel.LISTS or (
        kernel == Kernel.AUTOMATIC and radii.size > MOST_FOR_SCAN and skin > 0.0
    )
    order = np.arange(radii.size)
    if listed:
        order = in_space_order(positions, 2.0 * float(radii.max()) + skin)
    state = new_state(
        positions[order], velocities[order], radii[order], masses[order], species[order], rules
    )
    state.links[:, ORIGINAL] = order
    if spins.shape[0]:
        state.spins[:] = spins[order]
    if rules.sticky:
        state.masses[:, 1] = masses
        state.bodies[:, BODY] = order
    return with_lists(state, rules, skin) if listed else state
