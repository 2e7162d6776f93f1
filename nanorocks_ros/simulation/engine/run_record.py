"""Record of a run: frames, observations and events.

Tested by ``test/simulation/engine/test_reference_agreement.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.engine import observables as columns
from nanorocks_ros.simulation.engine.event_loop import (
    EVENTS,
    FIRST,
    IMPULSE,
    KIND,
    SECOND,
    SPEED,
    WHEN,
    RunOutput,
)
from nanorocks_ros.simulation.engine.gas_state import (
    COUNTS,
    FIX,
    LEDGER_SIZE,
    MERGE,
    PAIR,
    WALL,
    WALL_IMPULSE,
    WALLS,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

_FIRST_ROOM = 4096

EVENT = np.dtype(
    [
        ('time', 'f8'),
        ('kind', 'U5'),
        ('bead', 'i4'),
        ('partner', 'i4'),
        ('normal_speed', 'f8'),
        ('impulse', 'f8'),
    ]
)
_KINDS = {PAIR: 'pair', WALL: 'wall', MERGE: 'merge', FIX: 'fix'}


@dataclass(frozen=True, slots=True, kw_only=True)
class Observations:
    """Sums over the beads at some instants.

    Parameters
    ----------
    times : ndarray (n,), [s]
    mean_speed, mean_projected_speed : ndarray (n,), [m/s]
        In space, and in the plane of the picture (x, y).
    bodies : ndarray of int64, (n,)
        Beads that move together count once.
    granular_temperature : ndarray (n, n_species, 3), [m^2/s^2]
        Mean square of velocity along x, y and z; NaN for a species without beads.
    pair_collisions, wall_collisions, merges, fixings : ndarray of int64, (n,)
        Since the start.
    energy_lost : ndarray (n, 3), [J]
        Since the start: between beads, at walls, in merges.
    wall_impulse : ndarray (n, 6), [kg m/s]
        Normal momentum given to each wall since the start.
    """

    times: NDArray[np.float64]
    mean_speed: NDArray[np.float64]
    mean_projected_speed: NDArray[np.float64]
    bodies: NDArray[np.int64]
    granular_temperature: NDArray[np.float64]
    pair_collisions: NDArray[np.int64]
    wall_collisions: NDArray[np.int64]
    merges: NDArray[np.int64]
    fixings: NDArray[np.int64]
    energy_lost: NDArray[np.float64]
    wall_impulse: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRecord:
    """Frames, observations and events of a gas.

    Parameters
    ----------
    times : ndarray (n_frames,), [s]
    positions, velocities : ndarray (n_frames, n, 3), [m], [m/s]
        Positions are continuous across periodic sides.
    spins : ndarray (n_frames, n, 3) or None, [rad/s]
        None for smooth beads without bodies that turn. In these, each bead has the spin of its
        body; single ones have none.
    bodies : ndarray of int32, (n_frames, n), or None
        The smallest number of a bead in the body of each bead; None when nothing sticks.
    observations : Observations
    events : structured ndarray (n_events,)
        Fields time [s], kind (pair, wall, merge, fix), bead, partner (a bead, or the wall:
        0 to 5 for low and high x, y, z), normal_speed [m/s], impulse [kg m/s]. Empty when not
        asked for.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64] | None
    bodies: NDArray[np.int32] | None
    observations: Observations
    events: NDArray[np.void]


class RunRecorder:
    """Arrays for the output of a run, and their conversion to a `RunRecord`."""

    def __init__(
        self,
        state: State,
        rules: Rules,
        frame_times: NDArray[np.float64],
        observation_times: NDArray[np.float64],
        n_species: int,
        log: bool,
    ) -> None:
        n = state.rows.shape[0]
        frames = frame_times.size
        self._spinning, self._sticky = rules.rough or rules.rotating, rules.sticky
        self.output = RunOutput(
            frame_times=frame_times,
            positions=np.empty((frames, n, 3)),
            velocities=np.empty((frames, n, 3)),
            spins=np.empty((frames, n if self._spinning else 0, 3)),
            bodies=np.empty((frames, n if rules.sticky else 0), dtype=np.int32),
            observation_times=observation_times,
            observations=np.empty((observation_times.size, columns.columns(n_species))),
            events=np.empty((_FIRST_ROOM if log else 0, 6)),
            done=np.zeros(4, dtype=np.int64),
        )

    def make_room(self) -> None:
        """Double the room for events."""
        events = self.output.events
        self.output = self.output._replace(events=np.concatenate((events, np.empty_like(events))))

    def record(self) -> RunRecord:
        """The record of the run."""
        output = self.output
        return RunRecord(
            times=output.frame_times,
            positions=output.positions,
            velocities=output.velocities,
            spins=output.spins if self._spinning else None,
            bodies=output.bodies if self._sticky else None,
            observations=_observations(output.observation_times, output.observations),
            events=_events(output.events[: output.done[EVENTS]]),
        )


def _observations(times: NDArray[np.float64], rows: NDArray[np.float64]) -> Observations:
    counts = rows[:, columns.FIRST_COUNT : columns.FIRST_COUNT + COUNTS].astype(np.int64)
    ledger = rows[:, columns.FIRST_LEDGER : columns.FIRST_LEDGER + LEDGER_SIZE]
    n_species = (rows.shape[1] - columns.FIRST_SPECIES) // columns.PER_SPECIES
    shape = len(rows), n_species, columns.PER_SPECIES
    species = rows[:, columns.FIRST_SPECIES :].reshape(shape)
    squares = species[:, :, 1:]
    return Observations(
        times=times,
        mean_speed=rows[:, columns.MEAN_SPEED].copy(),
        mean_projected_speed=rows[:, columns.MEAN_PROJECTED_SPEED].copy(),
        bodies=rows[:, columns.BODIES].astype(np.int64),
        granular_temperature=np.where(species[:, :, :1] > 0.0, squares, np.nan),
        pair_collisions=counts[:, PAIR],
        wall_collisions=counts[:, WALL],
        merges=counts[:, MERGE],
        fixings=counts[:, FIX],
        energy_lost=ledger[:, :3].copy(),
        wall_impulse=ledger[:, WALL_IMPULSE : WALL_IMPULSE + WALLS].copy(),
    )


def _events(rows: NDArray[np.float64]) -> NDArray[np.void]:
    events = np.empty(len(rows), dtype=EVENT)
    kinds = np.array([_KINDS.get(place, '') for place in range(COUNTS)])
    events['time'] = rows[:, WHEN]
    events['kind'] = kinds[rows[:, KIND].astype(np.int64) - 1]
    events['bead'] = rows[:, FIRST]
    events['partner'] = rows[:, SECOND]
    events['normal_speed'] = rows[:, SPEED]
    events['impulse'] = rows[:, IMPULSE]
    return events
