"""Event-driven molecular dynamics of a granular gas of hard spheres in a box.

Tested by ``test/simulation/engine/test_reference_agreement.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine import checkpoint
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.event_loop import TAKEN, run_until
from nanorocks_ros.simulation.engine.gas_state import (
    COUNTER,
    DONE,
    LISTS_FULL,
    LOG_FULL,
    ORIGINAL,
    PREDICTED,
    QUANTUM,
)
from nanorocks_ros.simulation.engine.gas_view import GasView
from nanorocks_ros.simulation.engine.input_checks import (
    check_beads,
    check_drag,
    check_species,
    check_spins,
    check_times,
    overlapping_pair,
    refuse_overlap,
)
from nanorocks_ros.simulation.engine.kernel_choice import Kernel, arranged_state
from nanorocks_ros.simulation.engine.neighbours.huge_pages import in_large_pages
from nanorocks_ros.simulation.engine.neighbours.list_tuning import (
    rebuilt_lists,
)
from nanorocks_ros.simulation.engine.rules.collision_rules import (
    CollisionRules,
    restitution_table,
)
from nanorocks_ros.simulation.engine.run_record import RunRecord, RunRecorder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray


# Events between two checks for interrupts and stalls: some tenths of a second.
_SLICE = 200_000
# The run has stalled when each of this many slices advances time by less than this fraction of
# the time quantum.
_STUCK_SLICES = 10
_STUCK = 1e-9


class HardSphereGas(GasView):
    """Inelastic hard spheres in a box.

    Parameters
    ----------
    beads : Beads
        At time 0; inside the box, not overlapping.
    rules : CollisionRules
    kernel : Kernel
        Both give the same trajectories; automatic takes the faster one.

    Raises
    ------
    SimulationError
        For invalid beads: NaN, no radius or mass, overlapping, larger than the box, of
        an unknown species; or neighbour lists in a periodic box too small for them.
    """

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
        """The gas of a checkpoint; it continues bit by bit.

        Raises
        ------
        SimulationError
            For a file that is damaged, or no checkpoint.
        """
        gas = cls.__new__(cls)
        state, gas._rules, gas._n_species = checkpoint.load(path)
        gas._state = in_large_pages(state)
        gas._known_species = gas._n_species
        return gas

    def save(self, path: Path) -> None:
        """Write a checkpoint; an existing file is replaced.

        Raises
        ------
        SimulationError
            When it cannot be written.
        """
        checkpoint.save(path, self._state, self._rules, self._n_species)

    def follow(
        self,
        end: float,
        frame_times: Sequence[float] | NDArray[np.float64] = (),
        observation_times: Sequence[float] | NDArray[np.float64] = (),
        *,
        log: bool = False,
        most_events: int | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> RunRecord:
        """Follow the gas to a time; write frames, observations and events on the way.

        Parameters
        ----------
        end : float, [s]
            Not before `now`.
        frame_times, observation_times : array_like, [s]
            Rising, from `now` to `end`; an event at the time of a frame comes before the frame.
        log : bool
            Whether to keep every event.
        most_events : int or None
            Largest number of events of any kind.
        progress : callable or None
            Called with the time reached, a few times a second.

        Raises
        ------
        SimulationError
            When times go backwards, after too many events, or when time stalls (inelastic
            collapse). The run can then still be continued.
        """
        recorder = self._record(
            end,
            frame_times,
            observation_times,
            log=log,
            most_events=most_events,
            progress=progress,
        )
        return recorder.record()

    def _record(
        self,
        end: float,
        frame_times: Sequence[float] | NDArray[np.float64],
        observation_times: Sequence[float] | NDArray[np.float64],
        *,
        log: bool = False,
        most_events: int | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> RunRecorder:
        now = self.now
        frames = check_times(now, end, frame_times)
        observed = check_times(now, end, observation_times, 'observation_times')
        recorder = RunRecorder(self._state, self._rules, frames, observed, self._n_species, log)
        slow = 0
        while True:
            before = self.now
            taken = int(recorder.output.done[TAKEN])
            part = taken + _SLICE if most_events is None else min(taken + _SLICE, most_events)
            status = run_until(self._state, self._rules, float(end), part, recorder.output)
            if status == DONE:
                return recorder
            if status == LISTS_FULL:
                self._state = rebuilt_lists(self._state, self._rules)
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
        """Sums over the beads at some times, with the columns of `observables`.

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
        record = self.follow(end, frame_times, most_events=most_events)
        return record.positions, record.velocities

    def restart(self, beads: Beads) -> None:
        """Restart at time 0 with new positions, velocities and spins.

        Bodies are separated. Event counts, ledger and random restitutions continue.

        Parameters
        ----------
        beads : Beads
            As many as before.

        Raises
        ------
        SimulationError
            For another number of beads, or invalid beads.
        """
        before = self._state
        n = before.rows.shape[0]
        if np.size(beads.radii) != n:
            raise SimulationError('beads', f'{np.size(beads.radii)} of them', f'give {n}')
        changes = self._by_number(before.links[:, COUNTER])
        self._set(beads, self.kernel)
        self._state.links[:, COUNTER] = changes[self._state.links[:, ORIGINAL]]
        self._state.counts[:] = before.counts
        self._state.ledger[:] = before.ledger

    def kick(self, velocities: NDArray[np.float64]) -> None:
        """Give every bead a new velocity at its position, and restart at time 0.

        Parameters
        ----------
        velocities : ndarray (n, 3), [m/s]

        Raises
        ------
        SimulationError
            For velocities of another shape, or not finite.
        """
        self.restart(replace(self.beads(), velocities=velocities, spins=None))

    def _set(self, beads: Beads, kernel: Kernel) -> None:
        checked = check_beads(
            beads.radii, beads.masses, beads.positions, beads.velocities, self._rules
        )
        n = checked[0].size
        species = check_species(beads.species, n, self._known_species)
        spins = check_spins(beads.spins, n, self._rules.rough)
        drag = check_drag(beads.drag, n)
        n_species = max(int(species.max()) + 1, self._known_species)
        rules = self._rules._replace(
            restitution=restitution_table(self._rules.restitution, n_species)
        )
        state = arranged_state(checked, (species, spins, drag), rules, kernel)
        refuse_overlap(*overlapping_pair(state, rules))
        self._state, self._rules, self._n_species = state, rules, n_species
