"""Ensembles: many cooling runs of one tray.

Tested by ``test/simulation/test_shaken_tray.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.counter_rng import Purpose, key_for
from nanorocks_ros.simulation.engine import observables as columns
from nanorocks_ros.simulation.engine.event_loop import run_until
from nanorocks_ros.simulation.engine.flight.turning_motion import new_motions
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.gas_state import COUNTS, DONE, PAIR, WALL, State, new_state
from nanorocks_ros.simulation.engine.input_checks import (
    check_room,
    check_times,
)
from nanorocks_ros.simulation.engine.kernel_choice import MOST_FOR_SCAN
from nanorocks_ros.simulation.engine.rules.collision_rules import restitution_table
from nanorocks_ros.simulation.engine.run_record import RunRecorder
from nanorocks_ros.simulation.initial_state import (
    draw_diameters,
    draw_velocities,
    gas_viscosity,
    inventory,
    resting_beads,
    rules_of,
    set_drag,
    sphere_masses,
)
from nanorocks_ros.simulation.packing.random_placement import MOST_TRIES, pack_beads
from nanorocks_ros.simulation.shaken_tray import after_shaking, check_settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.initial_state import Inventory

_MOST_EVENTS = 10_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingRuns:
    """A cooling gas, run by run.

    Parameters
    ----------
    times : ndarray (n_times,), [s]
        Since the shaking event.
    mean_speed, mean_projected_speed : ndarray (n_runs, n_times), [m/s]
        Over the beads.
    bodies : ndarray of int64, (n_runs, n_times)
        Beads that move together count once.
    pair_collisions, wall_collisions : ndarray of int64, (n_runs,)
    """

    times: NDArray[np.float64]
    mean_speed: NDArray[np.float64]
    mean_projected_speed: NDArray[np.float64]
    bodies: NDArray[np.int64]
    pair_collisions: NDArray[np.int64]
    wall_collisions: NDArray[np.int64]


def cooling_runs(
    settings: SimulationSettings,
    tray: Tray,
    times: Sequence[float] | NDArray[np.float64],
    runs: Iterable[int],
) -> CoolingRuns:
    """Simulate the cooling of a tray after one shaking event, run by run.

    A run starts where `ShakenTray` of the same seed and run is after a shaking event at
    time 0, event by event.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    times : array_like (n_times,), [s]
        Since the shaking event; rising.
    runs : iterable of int
        Numbers of the runs.

    Raises
    ------
    ConfigurationError
        For a setting outside its range.
    SimulationError
        When the beads do not fit, or a run has events without end.
    """
    check_settings(settings)
    last = float(np.max(times)) if np.size(times) else 0.0
    instants = check_times(0.0, last, times)
    drawn = inventory(tray)
    small = drawn.density.size <= MOST_FOR_SCAN and settings.speeds != 'shaken'
    rows = [
        (_small_run if small else _large_run)(settings, tray, drawn, instants, run) for run in runs
    ]
    n_columns = columns.columns(int(drawn.species.max()) + 1)
    rows_of_runs = np.array(rows).reshape(len(rows), instants.size + 1, n_columns)
    counts = rows_of_runs[:, -1, columns.FIRST_COUNT : columns.FIRST_COUNT + COUNTS].astype(
        np.int64
    )
    return CoolingRuns(
        times=instants,
        mean_speed=rows_of_runs[:, :-1, columns.MEAN_SPEED],
        mean_projected_speed=rows_of_runs[:, :-1, columns.MEAN_PROJECTED_SPEED],
        bodies=rows_of_runs[:, :-1, columns.BODIES].astype(np.int64),
        pair_collisions=counts[:, PAIR],
        wall_collisions=counts[:, WALL],
    )


def _large_run(
    settings: SimulationSettings,
    tray: Tray,
    drawn: Inventory,
    instants: NDArray[np.float64],
    run: int,
) -> NDArray[np.float64]:
    """Observations at the instants, and at the last one again, (n_times + 1, n_columns)."""
    rules = rules_of(settings, tray, run)
    beads = after_shaking(settings, rules, resting_beads(settings, tray, run), run, 0)
    ends = instants[-1:] if instants.size else np.zeros(1)
    gas = HardSphereGas(beads, rules)
    rows: NDArray[np.float64] = gas.observe(np.concatenate((instants, ends)))
    return rows


def _small_run(
    settings: SimulationSettings,
    tray: Tray,
    drawn: Inventory,
    instants: NDArray[np.float64],
    run: int,
) -> NDArray[np.float64]:
    """The same with less Python: the gas begins in compiled code."""
    rules = rules_of(settings, tray, run).compiled()
    n_species = int(drawn.species.max()) + 1
    rules = rules._replace(restitution=restitution_table(rules.restitution, n_species))
    check_room(0.5 * drawn.diameter_high, rules)
    purposes = (Purpose.DIAMETERS, Purpose.POSITIONS, Purpose.VELOCITIES)
    keys = np.array([key_for(settings.seed, run, purpose) for purpose in purposes])
    ranges = np.stack((drawn.diameter_low, drawn.diameter_high, drawn.density))
    placed, fields = _begin(
        rules,
        ranges,
        drawn.species,
        keys,
        np.zeros((drawn.density.size, 2) if settings.drag > 0.0 else 0),
        gas_viscosity(settings, tray),
        new_motions(drawn.density.size, rules),
        settings.mean_speed,
        settings.speeds == 'maxwellian',
        settings.vertical_speed_factor,
    )
    if placed < drawn.density.size:
        raise SimulationError(
            f'tray {tray.number}, run {run}',
            'found no room for all beads',
            'give fewer or smaller beads',
        )
    state = State(*fields)
    ends = instants[-1:] if instants.size else np.zeros(1)
    times = np.concatenate((instants, ends))
    output = RunRecorder(state, rules, times[:0].copy(), times, n_species, log=False).output
    # Of the same types as for a single gas, so that the engine is compiled once for both.
    status = run_until(state, rules, float(times[-1]), _MOST_EVENTS, output)
    if status != DONE:
        raise SimulationError(
            f'tray {tray.number}, run {run}',
            f'more than {_MOST_EVENTS} events',
            'raise the restitution or shorten the run',
        )
    return output.observations


@compiled
def _begin(
    rules: Rules,
    ranges: NDArray[np.float64],
    species: NDArray[np.int32],
    keys: NDArray[np.uint64],
    drag: NDArray[np.float64],
    viscosity: float,
    motions: NDArray[np.float64],
    mean_speed: float,
    maxwell: bool,
    vertical: float,
) -> tuple[int, tuple[Any, ...]]:
    """Begin a run: the number of beads that found room, and the fields of the state of the gas."""
    diameters = draw_diameters(ranges[0], ranges[1], keys[0])
    sides = np.array((rules.sides[0], rules.sides[1], rules.sides[2]))
    radii = 0.5 * diameters
    positions, placed = pack_beads(radii, sides, np.zeros(3, dtype=np.bool_), keys[1], MOST_TRIES)
    masses = sphere_masses(diameters, ranges[2])
    set_drag(drag, diameters, ranges[2], viscosity)
    velocities = draw_velocities(masses, mean_speed, maxwell, vertical, keys[2], 0)
    state = new_state(positions, velocities, radii, masses, species, drag, motions, rules)
    return placed, state[:]
